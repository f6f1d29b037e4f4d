"""Shaded orthographic pictures of quadratic surfaces: each 9-node face is sampled densely into a depth buffer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from matplotlib.colors import Colormap, to_rgb
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, generate_binary_structure, maximum_filter, minimum_filter

from pliant.meshing.hexahedra import lagrange
from pliant.records.design import Array
from pliant.records.fem import IntArray

Image = NDArray[np.float32]
COARSE = 4  # fine pixels per pixel of images that are blurred
LIGHTS = (((-0.45, 0.65, 0.75), 0.62), ((0.75, 0.1, 0.55), 0.22))  # direction in the view, strength
AMBIENT = 0.5


@dataclass(frozen=True, eq=False)
class Look:
    """The appearance of a surface: a colour map over `limits` of the values or one colour, mesh lines, opacity."""

    colours: Colormap | None = None
    limits: tuple[float, float] = (0.0, 1.0)
    colour: str = "#d9dde4"
    mesh_lines: float = 0.0
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class Buffers:
    """The nearest sample of each fine pixel; depth is −inf without one."""

    depth: Image
    normal: Image
    value: Image
    line: Image


def shade(buffers: Buffers, look: Look) -> Image:
    """Return diffuse light, a soft highlight, darker grooves, mesh lines and outlines, as RGBA."""
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
    """Return how far each pixel is behind its surroundings, 0 to 1."""
    coarse = slice(None, None, COARSE)
    reach = 0.022 * max(covered.shape)
    filled = np.where(covered, depth, 0).astype(np.float32)
    weight = gaussian_filter(covered[coarse, coarse].astype(np.float32), reach / COARSE)
    around = gaussian_filter(filled[coarse, coarse], reach / COARSE) / np.maximum(weight, 1e-3)
    full = around.repeat(COARSE, axis=0).repeat(COARSE, axis=1)[: depth.shape[0], : depth.shape[1]]
    return np.asarray(np.clip((full - filled) / (2.5 * reach), 0, 1) * covered, np.float32)


def _outline(depth: Image, covered: NDArray[np.bool_]) -> Image:
    """Return 1 where a neighbour is much nearer or at the border of the body, else 0."""
    step = 0.03 * max(covered.shape)
    filled = np.where(covered, depth, -1e9)
    cross = generate_binary_structure(2, 1)
    around = [found(filled, footprint=cross) for found in (minimum_filter, maximum_filter)]
    jump = np.maximum(filled - around[0], around[1] - filled) > step
    return (jump & covered).astype(np.float32)


def reduced(image: Image, fine: int) -> Image:
    """Return the mean over the fine pixels of each pixel, weighted by opacity."""
    rows, columns = image.shape[0] // fine, image.shape[1] // fine
    blocks = image.reshape(rows, fine, columns, fine, 4)
    alpha = blocks[..., 3:].mean(axis=(1, 3))
    colour = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-6)
    return np.concatenate([colour, alpha], axis=2)


TRANSPOSED = [0, 3, 6, 1, 4, 7, 2, 5, 8]  # a face seen from its other side
SPACING = 0.75  # distance of samples, in fine pixels
MOST_SAMPLES = 400
ROUGH = 6  # fine pixels per pixel of the picture in which hidden faces are found


@dataclass(frozen=True, eq=False)
class Surface:
    """Faces (g, 9) over points (n, 3), normals ∂x/∂a × ∂x/∂b outward, with a value per point (n,)."""

    points: Array
    faces: IntArray
    values: Array

    def moved(self, rotation: Array, offset: Array) -> Surface:
        """Return the surface under a rigid motion x → R x + t."""
        return replace(self, points=self.points @ np.asarray(rotation).T + offset)

    def mirrored(self, axis: int) -> Surface:
        """Return the mirror image in the plane where this coordinate is 0."""
        points = self.points.copy()
        points[:, axis] *= -1
        return replace(self, points=points, faces=self.faces[:, TRANSPOSED])

    @staticmethod
    def joined(parts: Sequence[Surface]) -> Surface:
        """Return several surfaces as one."""
        starts = np.cumsum([0, *(len(p.points) for p in parts[:-1])])
        return Surface(
            np.concatenate([p.points for p in parts]),
            np.concatenate([p.faces + s for p, s in zip(parts, starts, strict=True)]),
            np.concatenate([p.values for p in parts]),
        )


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic view: unit vectors to the right, upwards and toward the viewer, (3,) each."""

    right: Array
    up: Array
    toward: Array

    @staticmethod
    def looking(toward: Array, up: Array) -> Camera:
        """Return the view from the direction `toward`, with `up` as far upwards as possible."""
        t = np.asarray(toward, float) / np.linalg.norm(toward)
        r = np.cross(up, t)
        r /= np.linalg.norm(r)
        return Camera(r, np.cross(t, r), t)

    def tilted(self, azimuth_rad: float, elevation_rad: float) -> Camera:
        """Return the view after rotating by the azimuth around `up` and then by the elevation."""
        side = np.cos(azimuth_rad) * self.toward + np.sin(azimuth_rad) * self.right
        return Camera.looking(np.cos(elevation_rad) * side + np.sin(elevation_rad) * self.up, self.up)

    def project(self, points: Array) -> Array:
        """Return (..., 3) coordinates to the right, upwards, toward the viewer."""
        return np.asarray(points) @ np.stack([self.right, self.up, self.toward], axis=1)


@dataclass(frozen=True, eq=False)
class Window:
    """The drawn part of the picture plane, (left, right, bottom, top), at `scale` pixels per unit.

    Each pixel is the mean of `fine` × `fine` samples.
    """

    box: tuple[float, float, float, float]
    scale: float
    fine: int = 2

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the image."""
        left, right, bottom, top = self.box
        return round((top - bottom) * self.scale), round((right - left) * self.scale)


def draw(surface: Surface, camera: Camera, window: Window, look: Look) -> Image:
    """Return the surface as an RGBA image (rows from the bottom, columns, 4) with values in [0, 1]."""
    buffers = _rasterise(surface, camera, window, look.mesh_lines)
    return reduced(shade(buffers, look), window.fine)


def over(front: Image, back: Image) -> Image:
    """Return one image laid over another (straight alpha)."""
    a, b = front[..., 3:], back[..., 3:] * (1 - front[..., 3:])
    alpha = a + b
    colour = (front[..., :3] * a + back[..., :3] * b) / np.maximum(alpha, 1e-6)
    return np.concatenate([colour, alpha], axis=2)


def bounding_box(
    surfaces: Sequence[Surface], camera: Camera, margin: float
) -> tuple[float, float, float, float]:
    """Return the smallest window box around all surfaces, with a margin."""
    flat = np.concatenate([camera.project(s.points)[:, :2] for s in surfaces])
    (left, bottom), (right, top) = flat.min(axis=0) - margin, flat.max(axis=0) + margin
    return float(left), float(right), float(bottom), float(top)


def _rasterise(surface: Surface, camera: Camera, window: Window, mesh_lines: float) -> Buffers:
    rows, columns = (window.fine * n for n in window.shape)
    scale = window.fine * window.scale
    seen = camera.project(surface.points) * scale
    seen[:, :2] -= np.array([window.box[0], window.box[2]]) * scale
    corner = np.concatenate([seen, surface.values[:, None]], axis=1).astype(np.float32)[surface.faces]
    corner = corner[_may_be_seen(corner)]
    corner = corner[_not_hidden(corner, columns, rows)]
    pixel, sample = _all_samples(corner, columns, rows, mesh_lines > 0)
    nearest = _nearest(pixel, sample[0], rows * columns)
    won = np.flatnonzero(sample[0] == nearest[pixel])
    out = np.zeros((5, rows * columns), np.float32)
    for channel in range(5):
        out[channel, pixel[won]] = sample[channel + 1, won]
    size = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    normal = (out[:3] / np.maximum(size, 1e-12)).T.reshape(rows, columns, 3)
    line = (out[4] < mesh_lines * window.fine).astype(np.float32)
    shape = (rows, columns)
    return Buffers(nearest.reshape(shape), normal, out[3].reshape(shape), line.reshape(shape))


def _all_samples(corner: Image, columns: int, rows: int, edges: bool) -> tuple[IntArray, Image]:
    """Return samples of all faces; faces of similar size are processed together."""
    pixels, collected = [np.zeros(0, np.int64)], [np.zeros((6, 0), np.float32)]
    counts = _counts(corner)
    for pair in np.unique(counts, axis=0):
        chosen = corner[(counts == pair).all(axis=1)]
        pixel, sample = _samples(chosen, (int(pair[0]), int(pair[1])), columns, rows, edges)
        pixels.append(pixel)
        collected.append(sample)
    return np.concatenate(pixels), np.concatenate(collected, axis=1)


def _nearest(pixel: IntArray, depth: Image, size: int) -> Image:
    nearest = np.full(size, -np.inf, np.float32)
    np.maximum.at(nearest, pixel, depth)
    return nearest


def _not_hidden(corner: Image, columns: int, rows: int) -> NDArray[np.bool_]:
    """Return a mask of faces (g, 9, 4) that a coarse picture does not show to be hidden; may include hidden ones."""
    small = (corner / np.array([ROUGH, ROUGH, ROUGH, 1])).astype(np.float32)
    few_columns, few_rows = columns // ROUGH + 1, rows // ROUGH + 1
    pixel, sample = _all_samples(small, few_columns, few_rows, edges=False)
    depth = _nearest(pixel, sample[0], few_rows * few_columns).reshape(few_rows, few_columns)
    farthest = minimum_filter(depth, 3, mode="constant", cval=-np.inf)
    N, *_ = face_shapes((5, 5))
    x, y, z = (N @ small[..., i].T for i in range(3))
    column, row = np.clip(x, 0, few_columns - 1).astype(int), np.clip(y, 0, few_rows - 1).astype(int)
    return np.asarray((z >= farthest[row, column] - 2).any(axis=0))


def _may_be_seen(corner: Image) -> NDArray[np.bool_]:
    """Return a mask of faces (g, 9, 4) that face the viewer at one or more nodes."""
    _, dA, dB, _ = face_shapes((3, 3))
    a, b = dA @ corner[..., :2], dB @ corner[..., :2]
    return np.asarray((a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0] > 0).any(axis=1))


def _counts(corner: Image) -> IntArray:
    """Return the numbers of samples (g, 2) along a and b, about a fine pixel apart, in steps of √2."""
    grid = corner[..., :2].reshape(-1, 3, 3, 2)
    # a parabola is slightly longer than its longer chord
    along_a = 2.2 * np.linalg.norm(np.diff(grid, axis=2), axis=-1).max(axis=(1, 2))
    along_b = 2.2 * np.linalg.norm(np.diff(grid, axis=1), axis=-1).max(axis=(1, 2))
    wanted = np.maximum(np.stack([along_a, along_b], axis=1) / SPACING + 1, 4)
    steps = np.ceil(np.log2(wanted) * 2) / 2
    return np.asarray(np.minimum(np.ceil(2**steps), MOST_SAMPLES).astype(np.int64))


def _samples(
    corner: Image, count: tuple[int, int], columns: int, rows: int, edges: bool
) -> tuple[IntArray, Image]:
    """Return samples of faces (g, 9, 4) that face the viewer.

    The result is pixels (q,) and (6, q): depth, normal (three, any length), value, distance to the face's border.
    """
    N, dA, dB, parameter = face_shapes(count)
    x, y, z, value = (corner[..., i].T for i in range(4))
    Ax, Ay, Az, Bx, By, Bz = dA @ x, dA @ y, dA @ z, dB @ x, dB @ y, dB @ z
    column, row = (N @ x).astype(np.int32), (N @ y).astype(np.int32)
    nz = Ax * By - Ay * Bx
    keep = (nz > 0) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    edge = np.zeros_like(nz)
    if edges:
        a, b = np.minimum(parameter, 1 - parameter).T
        edge = np.minimum(a[:, None] * np.sqrt(Ax**2 + Ay**2), b[:, None] * np.sqrt(Bx**2 + By**2))
    kept = [v[keep] for v in (N @ z, Ay * Bz - Az * By, Az * Bx - Ax * Bz, nz, N @ value, edge)]
    return (row[keep].astype(np.int64) * columns + column[keep]), np.stack(kept)


@cache
def face_shapes(count: tuple[int, int]) -> tuple[Image, Image, Image, Image]:
    """Return biquadratic shape functions and slopes (q, 9) at a grid of parameters (q, 2) in [0, 1]."""
    sa, sb = (np.linspace(0, 1, n) for n in count)
    (La, Da), (Lb, Db) = lagrange(sa), lagrange(sb)
    tables = [np.einsum("qb,pa->qpba", v, u).reshape(-1, 9) for u, v in ((La, Lb), (Da, Lb), (La, Db))]
    b, a = np.meshgrid(sb, sa, indexing="ij")
    N, dA, dB = (t.astype(np.float32) for t in tables)
    return N, dA, dB, np.stack([a.ravel(), b.ravel()], axis=1).astype(np.float32)
