"""Plans of tests are stored in a folder of their own."""

import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    """Keep plans out of the user's cache folder."""
    folder = tmp_path_factory.getbasetemp() / "evonav-cache"
    monkeypatch.setenv("EVONAV_CACHE", str(folder))
    return folder
