"""How a page is made: templates, pictures, numbers in words, files, and where a result comes from."""
