"""The `evonav doctor` command, which checks the installation."""
