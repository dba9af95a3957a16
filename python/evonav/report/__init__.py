"""Tables, maps and pages made from records."""
