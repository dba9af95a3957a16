"""What can keep a published dataset of houses away: a type for each cause, all of them `HouseError`s."""

from evonav.errors import HouseError


class DatasetError(HouseError):
    """A dataset cannot be had or used; the message ends with what works without it."""

    def __init__(self, message: str) -> None:
        super().__init__(message)


class DatasetMissingError(DatasetError):
    """It was never fetched."""


class DatasetNetworkError(DatasetError):
    """The dataset's host cannot be reached."""


class DatasetQuotaError(DatasetError):
    """The host answers that too much was asked of it: a rate limit, or the bandwidth of git-lfs."""


class DatasetAccessError(DatasetError):
    """The host knows no such repository or revision, or keeps it private."""


class DatasetCorruptError(DatasetError):
    """A file is not what was published: truncated, changed, or only a git-lfs pointer."""
