"""Every requirement with its measured value, and the independent calculations that the values are held against."""
