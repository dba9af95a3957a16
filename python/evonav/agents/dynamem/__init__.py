"""DynaMem: points that depth sees through are deleted, and what was not seen for long is looked at again."""
