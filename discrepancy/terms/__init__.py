"""Terms that are in no effect file: a library of them, their grammar, the file that one becomes."""
