"""Languages that print the statements of a program, each with a test of its own."""
