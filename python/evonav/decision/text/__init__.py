"""The text matcher: answers by rule, from the words of an instruction and remembered boxes."""
