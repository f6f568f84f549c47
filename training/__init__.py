"""How the shipped detector was trained: `python -m training DATA -o RUN`."""
