"""The fruit network: plain 3x3 convolutions and ReLU, one map at a quarter of the picture's size."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

__all__ = ["SIZE_PX", "WIDTHS", "FruitNetwork", "folded", "unfolded"]

SIZE_PX = 16.0
"""Half of the side of a usual fruit: what a distance to an edge of its box is told against."""

CHANNELS = 6
"""Of the map: logit of a fruit's centre; log of left, top, right, bottom over `SIZE_PX`; logit of the visible share."""

WIDTHS = (16, 32, 80, 144, 192)
"""Channels where the picture is a half, a quarter ... of its size: few where there are many cells."""

RARE = -4.6
"""Logit that the map begins with: one cell in a hundred is a fruit's centre."""


def _convolution(given: int, made: int, normalised: bool, stride: int = 1) -> nn.Sequential:
    convolution = nn.Conv2d(given, made, 3, stride, 1, bias=not normalised)
    return nn.Sequential(convolution, nn.BatchNorm2d(made) if normalised else nn.Identity(), nn.ReLU(inplace=True))


class FruitNetwork(nn.Module):
    """Takes pictures (N, 3, H, W), RGB from 0 to 1, sides divisible by 32; gives maps (N, 6, H / 4, W / 4).

    Parameters
    ----------
    normalised : bool
        With a normalisation by batches after each convolution: for training from nothing.
    wider : int
        Times the channels of the network that ships: a teacher has more.
    """

    def __init__(self, normalised: bool = True, wider: int = 1) -> None:
        super().__init__()
        self.wider = wider
        half, quarter, eighth, sixteenth, thirtysecond = (wider * made for made in WIDTHS)

        def block(given: int, made: int, stride: int = 1) -> nn.Sequential:
            return _convolution(given, made, normalised, stride)

        def thrice(given: int, made: int) -> nn.Sequential:
            return nn.Sequential(block(given, made, 2), block(made, made), block(made, made))

        self.stem = nn.Sequential(block(3, half, 2), block(half, quarter, 2), block(quarter, quarter))
        self.eighth = thrice(quarter, eighth)
        self.sixteenth = thrice(eighth, sixteenth)
        self.thirtysecond = thrice(sixteenth, thirtysecond)
        self.to_sixteenth, self.at_sixteenth = nn.Conv2d(thirtysecond, sixteenth, 1), block(sixteenth, sixteenth)
        self.to_eighth, self.at_eighth = nn.Conv2d(sixteenth, eighth, 1), block(eighth, eighth)
        self.to_quarter, self.at_quarter = nn.Conv2d(eighth, quarter, 1), block(quarter, quarter)
        self.map = nn.Conv2d(quarter, CHANNELS, 1)
        nn.init.normal_(self.map.weight, std=0.01)
        nn.init.zeros_(self.map.bias)
        self.map.bias.data[0] = RARE

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Give the maps of some pictures."""
        quarter = self.stem(pictures)
        eighth = self.eighth(quarter)
        sixteenth = self.sixteenth(eighth)
        thirtysecond = self.thirtysecond(sixteenth)
        sixteenth = self.at_sixteenth(sixteenth + _doubled(self.to_sixteenth(thirtysecond)))
        eighth = self.at_eighth(eighth + _doubled(self.to_eighth(sixteenth)))
        features = self.at_quarter(quarter + _doubled(self.to_quarter(eighth)))
        # Boxes need more than the 8 bits of a bfloat16's mantissa.
        with torch.autocast(pictures.device.type, enabled=False):
            return self.map(features.float())


def _doubled(features: torch.Tensor) -> torch.Tensor:
    return functional.interpolate(features, scale_factor=2.0, mode="nearest")


def folded(network: FruitNetwork) -> FruitNetwork:
    """Give a copy without normalisations: they have gone into the convolutions before them."""
    plain = FruitNetwork(normalised=False, wider=network.wider).eval()
    weights = network.state_dict()
    for name, module in network.named_modules():
        if isinstance(module, nn.BatchNorm2d):
            convolution = f"{name.removesuffix('.1')}.0"
            assert module.running_mean is not None
            assert module.running_var is not None
            gain = module.weight / torch.sqrt(module.running_var + module.eps)
            weights[f"{convolution}.weight"] = weights[f"{convolution}.weight"] * gain[:, None, None, None]
            weights[f"{convolution}.bias"] = module.bias - module.running_mean * gain
    plain.load_state_dict({name: weights[name] for name in plain.state_dict()})
    return plain


@torch.no_grad()
def unfolded(network: FruitNetwork, pictures: torch.Tensor) -> FruitNetwork:
    """Give a copy with a normalisation after each convolution again, that on these pictures changes nothing.

    The inverse of `folded`, so that a finished network can go on learning as it did: the statistics are those of the
    pictures (N, 3, H, W), and gain and shift undo them.
    """
    made = FruitNetwork(normalised=True, wider=network.wider)
    weights = made.state_dict() | network.state_dict()

    def fold_out(name: str, told: torch.Tensor) -> None:
        mean, variance = told.mean((0, 2, 3)), told.var((0, 2, 3))
        normalisation = f"{name.removesuffix('.0')}.1"
        bias = weights.pop(f"{name}.bias")
        weights[f"{normalisation}.running_mean"], weights[f"{normalisation}.running_var"] = mean - bias, variance
        weights[f"{normalisation}.weight"] = torch.sqrt(variance + nn.BatchNorm2d(1).eps)
        weights[f"{normalisation}.bias"] = mean

    convolutions = {name: module for name, module in network.named_modules() if isinstance(module, nn.Conv2d)}
    hooks = [
        module.register_forward_hook(lambda _module, _given, told, name=name: fold_out(name, told))
        for name, module in convolutions.items()
        if f"{name}.bias" not in made.state_dict()
    ]
    network(pictures)
    for hook in hooks:
        hook.remove()
    made.load_state_dict(weights)
    return made
