"""Houses: files, bundled ones, typed views."""
