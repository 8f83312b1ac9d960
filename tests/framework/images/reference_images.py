#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Other people's codecs, to compare ours with.

reference_images.py make FOLDER    writes pictures that our encoders cannot make, each with NAME.raw,
                                   the expected channels, and NAME.txt, "width height channels floats".
reference_images.py decode FOLDER  decodes every picture in the folder to NAME.raw, RGB(A) order.
"""
import os
import struct
import sys
import zlib

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2
import numpy as np


def expect(folder, name, pixels):
    height, width = pixels.shape[:2]
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    is_float = pixels.dtype == np.float32
    with open(f"{folder}/{name}.txt", "w", encoding="ascii") as out:
        out.write(f"{width} {height} {channels} {int(is_float)}\n")
    pixels.tofile(f"{folder}/{name}.raw")


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, depth, color, rows, extra=b"", interlace=0, part=1 << 30):
    head = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, interlace)
    packed = zlib.compress(rows)
    parts = [chunk(b"IDAT", packed[at:at + part]) for at in range(0, len(packed), part)]
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + extra + b"".join(parts) + chunk(b"IEND", b""))


def paeth(left, up, corner):
    guess = left + up - corner
    return min((left, up, corner), key=lambda value: abs(guess - value))


def filtered(pixels, kinds=(1, 2, 3, 4, 0)):
    """Rows with these filters in turn, as PNG's section 9.2 has them."""
    rows = b""
    above = None
    for y, row in enumerate(pixels.reshape(pixels.shape[0], -1).tolist()):
        stride = len(row) // pixels.shape[1]
        above = above or [0] * len(row)
        kind = int(kinds[y % len(kinds)])
        rows += bytes([kind])
        for i, value in enumerate(row):
            left, corner = (row[i - stride], above[i - stride]) if i >= stride else (0, 0)
            guess = (0, left, above[i], (left + above[i]) // 2, paeth(left, above[i], corner))[kind]
            rows += bytes([(value - guess) & 255])
        above = row
    return rows


def write(folder, name, data):
    with open(f"{folder}/{name}", "wb") as out:
        out.write(data)


def make_pngs(folder, rng):
    width, height = 11, 6
    palette = rng.integers(0, 256, (16, 3), dtype=np.uint8)
    index = rng.integers(0, 16, (height, width), dtype=np.uint8)
    packed = b"".join(
        b"\0" + bytes((row[i] << 4) | (row[i + 1] if i + 1 < width else 0) for i in range(0, width, 2))
        for row in index.tolist())
    write(folder, "palette.png", png(width, height, 4, 3, packed, chunk(b"PLTE", palette.tobytes())))
    expect(folder, "palette.png", palette[index])

    alpha = rng.integers(0, 256, 16, dtype=np.uint8)
    write(folder, "palette_alpha.png",
          png(width, height, 4, 3, packed,
              chunk(b"PLTE", palette.tobytes()) + chunk(b"tRNS", alpha.tobytes())))
    expect(folder, "palette_alpha.png", np.dstack([palette[index], alpha[index]]))

    bits = rng.integers(0, 2, (height, width), dtype=np.uint8)
    write(folder, "bits.png", png(width, height, 1, 0, b"".join(
        b"\0" + np.packbits(row).tobytes() for row in bits)))
    expect(folder, "bits.png", bits * np.uint8(255))

    deep = rng.integers(0, 65536, (height, width, 3), dtype=np.uint16)
    write(folder, "rgb16.png", png(width, height, 16, 2, b"".join(
        b"\0" + row.astype(">u2").tobytes() for row in deep)))
    expect(folder, "rgb16.png", (deep / np.float32(65535)).astype(np.float32))

    grey_alpha = rng.integers(0, 256, (height, width, 2), dtype=np.uint8)
    adam7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2),
             (0, 1, 1, 2)]
    rows = b"".join(b"\0" + row.tobytes() for x, y, dx, dy in adam7
                    if grey_alpha[y::dy, x::dx].size for row in grey_alpha[y::dy, x::dx])
    write(folder, "interlaced.png", png(width, height, 8, 4, rows, interlace=1))
    expect(folder, "interlaced.png", grey_alpha)

    for channels, color in ((1, 0), (2, 4), (3, 2), (4, 6)):
        pixels = rng.integers(0, 256, (23, 19, channels), dtype=np.uint8)
        pixels[12:, 5:] //= 16  # where neighbours are alike and filters meet ties
        name = f"filters_{channels}.png"
        text = chunk(b"tEXt", b"Comment\0between header and pixels")
        write(folder, name, png(19, 23, 8, color, filtered(pixels), text, part=100))
        expect(folder, name, pixels)
        for width in (1, 6, 26):  # several rows are undone at once
            pixels = rng.integers(0, 256, (40, width, channels), dtype=np.uint8)
            pixels[10:20] //= 64
            name = f"runs_{channels}_{width}.png"
            kinds = rng.choice([4, 4, 4, 4, 4, 0, 1, 2, 3], 40)
            write(folder, name, png(width, 40, 8, color, filtered(pixels, kinds)))
            expect(folder, name, pixels)
    clear = rng.integers(0, 2, (4, 5, 3), dtype=np.uint8) * 255
    write(folder, "one_colour_clear.png", png(5, 4, 8, 2, filtered(clear),
                                              chunk(b"tRNS", struct.pack(">HHH", 255, 0, 255))))
    hidden = np.where((clear == (255, 0, 255)).all(axis=2), 0, 255).astype(np.uint8)
    expect(folder, "one_colour_clear.png", np.dstack([clear, hidden]))


def make_tgas(folder, rng):
    width, height = 9, 5
    rgba = rng.integers(0, 256, (height, width, 4), dtype=np.uint8)
    bgra = rgba[..., [2, 1, 0, 3]]
    head = lambda kind, bits, flags: struct.pack("<BBBHHBHHHHBB", 3, 0, kind, 0, 0, 0, 0, 0, width,
                                                 height, bits, flags) + b"id!"
    write(folder, "plain.tga", head(2, 32, 0x28) + bgra.tobytes())
    expect(folder, "plain.tga", rgba)
    write(folder, "upward.tga", head(2, 24, 0) + bgra[::-1, :, :3].tobytes())
    expect(folder, "upward.tga", np.ascontiguousarray(rgba[..., :3]))
    rows = b""
    for row in bgra[::-1, :, :3]:
        rows += bytes([0x80 | 3]) + row[0].tobytes() + bytes([width - 5]) + row[4:].tobytes()
    runs = rgba[..., :3].copy()
    runs[:, :4] = runs[:, :1]
    write(folder, "runs.tga", head(10, 24, 0) + rows)
    expect(folder, "runs.tga", runs)
    grey = rgba[..., 0].copy()
    write(folder, "grey.tga", head(3, 8, 0x20) + grey.tobytes())
    expect(folder, "grey.tga", grey)


def make_others(folder, rng):
    smooth = cv2.GaussianBlur(rng.integers(0, 256, (21, 34, 3), dtype=np.uint8), (9, 9), 3)
    for name in ("picture.bmp", "picture.jpg"):
        cv2.imwrite(f"{folder}/{name}", smooth)
        expect(folder, name, np.ascontiguousarray(cv2.imread(f"{folder}/{name}")[..., ::-1]))
    for name in ("grey.bmp", "grey.jpg"):
        cv2.imwrite(f"{folder}/{name}", smooth[..., 0])
    expect(folder, "grey.bmp", np.dstack([smooth[..., 0]] * 3))
    expect(folder, "grey.jpg", cv2.imread(f"{folder}/grey.jpg", cv2.IMREAD_GRAYSCALE))
    light = np.exp(rng.normal(0, 3, (13, 21, 3))).astype(np.float32)
    for name in ("light.hdr", "light.exr"):
        cv2.imwrite(f"{folder}/{name}", light)
        read = cv2.imread(f"{folder}/{name}", cv2.IMREAD_UNCHANGED)
        expect(folder, name, np.ascontiguousarray(read[..., ::-1]))


def tiff(order, pixels, compression=1, rows_per_strip=None):
    """One page, by TIFF 6.0: the directory first, then what it points at, then strips."""
    height, width = pixels.shape[:2]
    samples = 1 if pixels.ndim == 2 else pixels.shape[2]
    rows = rows_per_strip or height
    strips = [pixels[y:y + rows].astype(pixels.dtype.newbyteorder(order)).tobytes()
              for y in range(0, height, rows)]
    if compression == 8:
        strips = [zlib.compress(strip) for strip in strips]
    bits = 8 * pixels.dtype.itemsize
    sample_format = 3 if pixels.dtype.kind == "f" else 1
    fields = [(256, 3, [width]), (257, 3, [height]), (258, 3, [bits] * samples), (259, 3, [compression]),
              (262, 3, [1 if samples == 1 else 2]), (273, 4, [0] * len(strips)), (277, 3, [samples]),
              (278, 3, [rows]), (279, 4, [len(strip) for strip in strips]),
              (339, 3, [sample_format] * samples)]

    def pack(kind, values):
        return struct.pack(order + ("H" if kind == 3 else "I") * len(values), *values)

    def layout(offsets):
        directory, more = b"", b""
        more_at = 8 + 2 + 12 * len(fields) + 4
        for tag, kind, values in fields:
            data = pack(kind, offsets if tag == 273 else values)
            if len(data) > 4:
                value = struct.pack(order + "I", more_at + len(more))
                more += data + b"\0" * (len(data) % 2)
            else:
                value = data.ljust(4, b"\0")
            directory += struct.pack(order + "HHI", tag, kind, len(values)) + value
        head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8)
        return head + struct.pack(order + "H", len(fields)) + directory + struct.pack(order + "I", 0) + more

    size = len(layout([0] * len(strips)))
    offsets = [size + sum(map(len, strips[:i])) for i in range(len(strips))]
    return layout(offsets) + b"".join(strips)


def make_opencvs(folder, rng):
    """What the program leaves to OpenCV: files by hand where that is simple."""
    deep = rng.integers(0, 65536, (7, 13, 3), dtype=np.uint16)
    write(folder, "deep.tif", tiff(">", deep))
    expect(folder, "deep.tif", (deep / np.float32(65535)).astype(np.float32))
    light = np.exp(rng.normal(0, 3, (9, 5, 3))).astype(np.float32)
    write(folder, "light.tif", tiff("<", light, rows_per_strip=4))
    expect(folder, "light.tif", light)
    grey = rng.integers(0, 256, (6, 11), dtype=np.uint8)
    write(folder, "grey.tif", tiff("<", grey, compression=8))
    expect(folder, "grey.tif", grey)
    smooth = cv2.GaussianBlur(rng.integers(0, 256, (21, 34, 3), dtype=np.uint8), (9, 9), 3)
    cv2.imwrite(f"{folder}/picture.webp", smooth, [cv2.IMWRITE_WEBP_QUALITY, 101])
    expect(folder, "picture.webp", np.ascontiguousarray(smooth[..., ::-1]))
    large = cv2.resize(smooth, (48, 40))
    cv2.imwrite(f"{folder}/picture.jp2", large)
    expect(folder, "picture.jp2", np.ascontiguousarray(cv2.imread(f"{folder}/picture.jp2")[..., ::-1]))


def decode_all(folder):
    for name in sorted(os.listdir(folder)):
        if not name.endswith((".png", ".jpg", ".hdr", ".exr")):
            continue
        pixels = cv2.imread(f"{folder}/{name}", cv2.IMREAD_UNCHANGED)
        if pixels is None:
            sys.exit(f"{name}: OpenCV cannot read it")
        if pixels.ndim == 3:
            pixels = pixels[..., [2, 1, 0, 3][:pixels.shape[2]]]
        np.ascontiguousarray(pixels).tofile(f"{folder}/{name}.raw")


def main():
    command, folder = sys.argv[1:]
    if command == "decode":
        decode_all(folder)
        return
    rng = np.random.default_rng(7)
    make_pngs(folder, rng)
    make_tgas(folder, rng)
    make_others(folder, rng)
    make_opencvs(folder, rng)


main()
