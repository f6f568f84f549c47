"""What the verbs that read reconstructions are told: flags with their help, shared by `metric` and `triangulate`."""

from __future__ import annotations

import typer

model_argument = typer.Argument(metavar="MODEL", help="Folder of a COLMAP model, text or binary.")
detections_option = typer.Option(
    None,
    metavar="FILE",
    help="Boxes: a table by image, as `pomona detect` writes it, or by frame, as for `pomona scan`; else --model.",
)
model_option = typer.Option(None, metavar="ONNX", help="Detector instead of boxes: a file, or shipped.")
pictures_option = typer.Option(
    None, metavar="DIR", help="Folder of the model's pictures; needed where a detector looks at them."
)
min_score_option = typer.Option(None, min=0.0, max=1.0, help="Least confidence of the model's boxes.")
