"""Write a digital controller as C, structured text, Python and JSON, and read the JSON back."""
