"""From the nearest sample of each pixel to a picture: light, grooves, mesh lines, outlines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import Colormap, to_rgb
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Image = NDArray[np.float32]
COARSE = 4  # fine pixels per pixel of what is blurred anyway
LIGHTS = (((-0.45, 0.65, 0.75), 0.62), ((0.75, 0.1, 0.55), 0.22))  # direction in the view, strength
AMBIENT = 0.5


@dataclass(frozen=True, eq=False)
class Look:
    """How a surface is drawn: a colour map over `limits` of the values or one colour, mesh lines, opacity."""

    colours: Colormap | None = None
    limits: tuple[float, float] = (0.0, 1.0)
    colour: str = "#d9dde4"
    mesh_lines: float = 0.0
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class Buffers:
    """The nearest sample of each fine pixel; depth is −inf where there is none."""

    depth: Image
    normal: Image
    value: Image
    line: Image


def shade(buffers: Buffers, look: Look) -> Image:
    """Diffuse light, a soft highlight, darker grooves, mesh lines and outlines, as RGBA."""
    covered = np.isfinite(buffers.depth)
    normal = buffers.normal
    light = np.full(covered.shape, AMBIENT, np.float32)
    for direction, strength in LIGHTS:
        unit = np.array(direction, np.float32) / np.float32(np.linalg.norm(direction))
        light += strength * np.clip(normal @ unit, 0, None)
    half = np.array([-0.25, 0.38, 0.89], np.float32)
    highlight = 0.16 * np.clip(normal @ half, 0, None) ** 24
    light *= 1 - 0.55 * _grooves(buffers.depth, covered)
    light *= 1 - 0.38 * buffers.line
    colour = _colours(buffers.value, look) * light[..., None] + highlight[..., None]
    outline = _outline(buffers.depth, covered)
    colour = np.clip(colour, 0, 1) * (1 - 0.6 * outline[..., None])
    alpha = covered * np.maximum(look.opacity, 0.55 * outline if look.opacity < 1 else 0)
    return np.concatenate([colour, alpha[..., None]], axis=2).astype(np.float32)


def _colours(value: Image, look: Look) -> Image:
    if look.colours is None:
        return np.broadcast_to(np.array(to_rgb(look.colour), np.float32), (*value.shape, 3))
    low, high = look.limits
    table = np.asarray(look.colours(np.linspace(0, 1, 256)))[:, :3].astype(np.float32)
    step = np.clip((value - low) / max(high - low, 1e-12) * 255, 0, 255).astype(np.int64)
    return np.asarray(table[step])


def _grooves(depth: Image, covered: NDArray[np.bool_]) -> Image:
    """How far each pixel lies behind its surroundings, 0 to 1."""
    coarse = slice(None, None, COARSE)
    reach = 0.022 * max(covered.shape)
    filled = np.where(covered, depth, 0).astype(np.float32)
    weight = gaussian_filter(covered[coarse, coarse].astype(np.float32), reach / COARSE)
    around = gaussian_filter(filled[coarse, coarse], reach / COARSE) / np.maximum(weight, 1e-3)
    full = around.repeat(COARSE, axis=0).repeat(COARSE, axis=1)[: depth.shape[0], : depth.shape[1]]
    return np.asarray(np.clip((full - filled) / (2.5 * reach), 0, 1) * covered, np.float32)


def _outline(depth: Image, covered: NDArray[np.bool_]) -> Image:
    """1 where a neighbour is much nearer or where the body ends."""
    step = 0.03 * max(covered.shape)
    filled = np.where(covered, depth, -1e9)
    mark = np.zeros(covered.shape, bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(filled, axis=axis)) > step
        first = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        second = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        mark[first] |= jump
        mark[second] |= jump
    return (mark & covered).astype(np.float32)


def reduced(image: Image, fine: int) -> Image:
    """Mean over the fine pixels of each pixel, weighted by opacity."""
    rows, columns = image.shape[0] // fine, image.shape[1] // fine
    blocks = image.reshape(rows, fine, columns, fine, 4)
    alpha = blocks[..., 3:].mean(axis=(1, 3))
    colour = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-6)
    return np.concatenate([colour, alpha], axis=2)
