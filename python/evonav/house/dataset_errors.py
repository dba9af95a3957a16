"""Errors of a published dataset of houses: one type for each cause, all of them `HouseError`s."""

from evonav.errors import HouseError


class DatasetError(HouseError):
    """A dataset cannot be fetched or used; the message ends with an alternative."""


class DatasetMissingError(DatasetError):
    """The dataset was never fetched."""


class DatasetNetworkError(DatasetError):
    """The dataset's host cannot be reached."""


class DatasetQuotaError(DatasetError):
    """The host refuses too many requests: a rate limit, or the bandwidth of git-lfs."""


class DatasetAccessError(DatasetError):
    """The host does not have this repository or revision, or it is private."""


class DatasetCorruptError(DatasetError):
    """A file differs from the published one: truncated, changed, or only a git-lfs pointer."""
