#!/usr/bin/env python3
"""Makes the tiles of a country that exist by their headers alone: LAS files of the right length, all hole.

    country.py OUT [--tiles 50000] [--points 12000000]

The files take a disk block each. What plans from headers (`convert --dry-run`) sees a country of tiles * points points;
whoever reads the points finds zeros.
"""

import argparse
import os
import struct

RECORD = 34  # format 3: with GPS time and colour
TILE = (1000.0, 1250.0)  # metres


def header(index, column, row, points):
    x, y = column * TILE[0], 300_000 + row * TILE[1]
    low, high = -5.0 - index % 7, 40.0 + index % 211
    return struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I3d3d6d",
        b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, 2, b"country", b"country.py", 1, 2026, 227, 227, 0, 3, RECORD, points,
        points, 0, 0, 0, 0, 0.001, 0.001, 0.001, 0.0, 0.0, 0.0, x + TILE[0] - 0.001, x, y + TILE[1] - 0.001, y, high, low,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--tiles", type=int, default=50_000)
    parser.add_argument("--points", type=int, default=12_000_000, help="points of a tile")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    columns = int(args.tiles**0.5) or 1
    for index in range(args.tiles):
        column, row = index % columns, index // columns
        with open(os.path.join(args.out, f"{column:03}_{row:03}.las"), "wb") as file:
            file.write(header(index, column, row, args.points))
            file.truncate(227 + args.points * RECORD)


if __name__ == "__main__":
    main()
