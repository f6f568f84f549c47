"""What the verbs that localise are told: flags with their help, shared by `localize` and `ros replay`."""

from __future__ import annotations

import typer

single_option = typer.Option(False, "--single", help="Find each frame from nothing, not from the one before.")
detections_option = typer.Option(
    None, metavar="FILE", help="Boxes, as for `pomona scan`; else detections.csv or ids/ there, else --model."
)
model_option = typer.Option(None, metavar="ONNX", help="Detector instead of boxes: a file, or shipped.")
min_score_option = typer.Option(None, min=0.0, max=1.0, help="Least confidence of the model's boxes.")
depth_option = typer.Option(
    "auto", metavar="auto|stereo|dense|ONNX", help="Depth pictures, else stereo at the fruits; or stereo all over."
)
index_option = typer.Option(
    None, "--index", metavar="FILE", help="Index of a large ORCHARD, which opens at once; made where there is none."
)
odometry_option = typer.Option(False, "--odometry", help="Motion from the pictures, even where poses were recorded.")
