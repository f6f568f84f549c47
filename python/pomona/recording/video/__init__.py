"""Stereo video: which stretches to decode, one file after the other, and left with right."""
