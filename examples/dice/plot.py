#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws results.csv as a picture: plot.py results.csv > results.svg

Each line of the table is one training: what it was made of, the number of pictures, steps, seed, AP50, AP.
Rows are what was tried, in the table's order; dots are trainings, a stroke their mean.
"""
import csv
import sys
from xml.sax.saxutils import escape

LEFT, ROW, WIDTH, TOP = 480, 22, 420, 46
COLORS = {"AP50": "#1f6f8b", "AP": "#c2571a"}


def main():
    with open(sys.argv[1], newline="") as file:
        results = list(csv.DictReader(file))
    rows = {}
    for result in results:
        title = f"{result['what']}, {result['pictures']} pictures, {result['steps']} steps"
        rows.setdefault(title, []).append(result)
    height = TOP + ROW * len(rows) + 24

    def x_of(value):
        return LEFT + WIDTH * float(value)

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{LEFT + WIDTH + 30}" height="{height}" '
           'font-family="sans-serif" font-size="12">',
           '<rect width="100%" height="100%" fill="white"/>']
    for i, (name, color) in enumerate(COLORS.items()):
        out.append(f'<circle cx="{LEFT + 90 * i + 6}" cy="14" r="4" fill="{color}"/>'
                   f'<text x="{LEFT + 90 * i + 16}" y="18">{name}</text>')
    for tenth in range(11):
        x = x_of(tenth / 10)
        out.append(f'<line x1="{x}" x2="{x}" y1="{TOP - 8}" y2="{height - 20}" stroke="#dddddd"/>'
                   f'<text x="{x}" y="{TOP - 12}" text-anchor="middle" fill="#555555">{tenth / 10}</text>')
    for i, (title, group) in enumerate(rows.items()):
        y = TOP + ROW * i + ROW / 2
        out.append(f'<text x="{LEFT - 12}" y="{y + 4}" text-anchor="end">{escape(title)}</text>')
        for name, color in COLORS.items():
            values = [float(result[name]) for result in group]
            mean = x_of(sum(values) / len(values))
            out.append(f'<line x1="{mean}" x2="{mean}" y1="{y - 8}" y2="{y + 8}" stroke="{color}"/>')
            out += [f'<circle cx="{x_of(value)}" cy="{y}" r="3.5" fill="{color}" fill-opacity="0.6"/>'
                    for value in values]
    out.append("</svg>")
    print("\n".join(out))


if __name__ == "__main__":
    main()
