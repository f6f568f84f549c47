"""The fruit network: plain 3x3 convolutions and ReLU, one map at a quarter of the picture's size."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

__all__ = ["SIZE_PX", "FruitNetwork", "folded"]

SIZE_PX = 16.0
"""Half of the side of a usual fruit: what a distance to an edge of its box is told against."""

CHANNELS = 6
"""Of the map: logit of a fruit's centre; log of left, top, right, bottom over `SIZE_PX`; logit of the visible share."""

RARE = -4.6
"""Logit that the map begins with: one cell in a hundred is a fruit's centre."""


def _convolution(given: int, made: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(given, made, 3, stride, 1, bias=False), nn.BatchNorm2d(made), nn.ReLU(inplace=True)
    )


class FruitNetwork(nn.Module):
    """Takes pictures (N, 3, H, W), RGB from 0 to 1, sides divisible by 16; gives maps (N, 6, H / 4, W / 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(_convolution(3, 16, 2), _convolution(16, 32, 2), _convolution(32, 32))
        self.eighth = nn.Sequential(_convolution(32, 96, 2), _convolution(96, 96), _convolution(96, 96))
        self.sixteenth = nn.Sequential(_convolution(96, 144, 2), _convolution(144, 144), _convolution(144, 144))
        self.to_eighth, self.at_eighth = nn.Conv2d(144, 96, 1), _convolution(96, 96)
        self.to_quarter, self.at_quarter = nn.Conv2d(96, 32, 1), _convolution(32, 32)
        self.map = nn.Conv2d(32, CHANNELS, 1)
        nn.init.normal_(self.map.weight, std=0.01)
        nn.init.zeros_(self.map.bias)
        self.map.bias.data[0] = RARE

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Give the maps of some pictures."""
        quarter = self.stem(pictures)
        eighth = self.eighth(quarter)
        sixteenth = self.sixteenth(eighth)
        eighth = self.at_eighth(eighth + _doubled(self.to_eighth(sixteenth)))
        features = self.at_quarter(quarter + _doubled(self.to_quarter(eighth)))
        # Boxes need more than the 8 bits of a bfloat16's mantissa.
        with torch.autocast("cpu", enabled=False):
            return self.map(features.float())


def _doubled(features: torch.Tensor) -> torch.Tensor:
    return functional.interpolate(features, scale_factor=2.0, mode="nearest")


def folded(network: FruitNetwork) -> FruitNetwork:
    """Give a copy whose normalisations have gone into the convolutions before them."""
    copy = FruitNetwork()
    copy.load_state_dict(network.state_dict())
    copy.eval()
    for module in list(copy.modules()):
        if isinstance(module, nn.Sequential) and len(module) > 1 and isinstance(module[1], nn.BatchNorm2d):
            module[0] = torch.nn.utils.fusion.fuse_conv_bn_eval(module[0], module[1])
            module[1] = nn.Identity()
    return copy
