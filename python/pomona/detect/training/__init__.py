"""Training of the fruit network, in plain PyTorch (extra `train`), which is imported when training begins."""
