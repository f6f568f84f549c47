"""What can be wrong with a recording that opens: pictures that cannot be read, left and right swapped."""
