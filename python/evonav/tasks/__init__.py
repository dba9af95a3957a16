"""Tasks on disk: public and oracle parts, apart."""
