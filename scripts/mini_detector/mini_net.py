"""The mini detector's network in torch; `evonav_core::perception::mini` runs the same layers."""

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

SIDE_PX = 150
"""Pictures are resized to this square; the network answers for cells of two by two pixels."""
CHANNELS = (24, 48, 96, 128)
DECODER = 48


def inputs(rgb: NDArray[np.uint8], depth_m: NDArray[np.float16], horizons_rad: NDArray[np.float64]) -> torch.Tensor:
    """`(B, 6, 150, 150)`: colours, depth, height below the camera, nearness."""
    z_m = torch.from_numpy(depth_m.astype(np.float32)).clamp(0.05, 20.0)
    row = (torch.arange(SIDE_PX, dtype=torch.float32) + 0.5) / (SIDE_PX / 2) - 1.0  # of a 90 degree field of view
    sin, cos = (torch.from_numpy(part(horizons_rad).astype(np.float32))[:, None] for part in (np.sin, np.cos))
    colours = torch.from_numpy(rgb).permute(0, 3, 1, 2).float() / 127.5 - 1.0
    below_m = z_m * (sin + cos * row)[:, :, None]
    return torch.cat(
        [colours, torch.stack([z_m.clamp(max=10.0) / 5 - 1, below_m.clamp(-3, 3), 1 / z_m.clamp(min=0.25) - 1], 1)], 1
    )


def _conv(c_in: int, c_out: int, size: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(c_in, c_out, size, stride, size // 2, groups=groups, bias=False), nn.BatchNorm2d(c_out)
    )


class MiniNet(nn.Module):
    """A small U-Net: class logits and links to the right and downward neighbour, for every cell."""

    def __init__(self, num_classes: int) -> None:
        super().__init__()
        a, b, c, d = CHANNELS
        self.num_classes = num_classes
        self.stem = _conv(6, a, 3, 2)
        self.down1, self.mid1 = _conv(a, b, 3, 2), _conv(b, b, 3)
        self.down2, self.mid2, self.mid2b = _conv(b, c, 3, 2), _conv(c, c, 3), _conv(c, c, 3)
        self.down3, self.mid3, self.mid3b = _conv(c, d, 3, 2), _conv(d, d, 3), _conv(d, d, 3)
        self.up3, self.skip2, self.fuse2 = _conv(d, DECODER, 1), _conv(c, DECODER, 1), _conv(DECODER, DECODER, 3)
        self.skip1, self.fuse1 = _conv(b, DECODER, 1), _conv(DECODER, DECODER, 3)
        self.skip0 = _conv(a, DECODER, 1)
        self.fuse0d, self.fuse0p = _conv(DECODER, DECODER, 3, groups=DECODER), _conv(DECODER, DECODER, 1)
        self.head = nn.Conv2d(DECODER, num_classes + 3, 1)  # background, classes, two links
        nn.init.zeros_(self.head.bias)
        with torch.no_grad():
            self.head.bias[0] = math.log(num_classes * 5.0)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """`(B, 1 + classes + 2, 75, 75)` logits."""
        return self.head(self.features(x))

    def features(self, x: torch.Tensor) -> torch.Tensor:
        """`(B, 48, 75, 75)`, of which the head makes logits cell by cell."""
        r = torch.relu
        e0 = r(self.stem(x))
        e1 = r(self.down1(e0))
        e1 = r(e1 + self.mid1(e1))
        e2 = r(self.down2(e1))
        e2 = r(e2 + self.mid2b(r(self.mid2(e2))))
        e3 = r(self.down3(e2))
        e3 = r(e3 + self.mid3b(r(self.mid3(e3))))
        y = r(_up(self.up3(e3), e2) + self.skip2(e2))
        y = r(self.fuse2(y))
        y = r(_up(y, e1) + self.skip1(e1))
        y = r(self.fuse1(y))
        y = r(_up(y, e0) + self.skip0(e0))
        return r(y + self.fuse0p(r(self.fuse0d(y))))


def _up(x: torch.Tensor, like: torch.Tensor) -> torch.Tensor:
    """Twice the size by repetition, cut to `like`."""
    return x.repeat_interleave(2, 2).repeat_interleave(2, 3)[:, :, : like.shape[2], : like.shape[3]]
