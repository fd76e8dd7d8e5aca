// Scans as columns: written as LAS 1.2, and read from LAS or LAZ by a decoder that is not ours (laz-perf),
// so that what clients show is compared with the scan and not with what pointmill says of it.

import { readFileSync, writeFileSync } from "node:fs";
import { Las } from "copc";

const HEADER = 227;
/** Bytes of a record, and where GPS time and colour begin, for each point format; null where it has none. */
const RECORDS = {
  0: { bytes: 20, time: null, colour: null },
  1: { bytes: 28, time: 20, colour: null },
  2: { bytes: 26, time: null, colour: 20 },
  3: { bytes: 34, time: 20, colour: 28 },
};

/**
 * Writes `scan` to `path`. A scan is `{ format, scale, offset, columns }`: `scale` and `offset` have three numbers, columns
 * are arrays of one length: X, Y, Z (integers, world = X · scale + offset), intensity, classification and, as far as the
 * format has them, r, g, b (16 bits) and time.
 */
export function writeLas(path, { format, scale, offset, columns }) {
  const { bytes, time, colour } = RECORDS[format];
  const count = columns.X.length;
  const file = Buffer.alloc(HEADER + count * bytes);
  file.write("LASF");
  file.writeUInt8(1, 24);
  file.writeUInt8(2, 25);
  file.write("tests/clients", 58);
  file.writeUInt16LE(HEADER, 94);
  file.writeUInt32LE(HEADER, 96);
  file.writeUInt8(format, 104);
  file.writeUInt16LE(bytes, 105);
  file.writeUInt32LE(count, 107);
  file.writeUInt32LE(count, 111); // all are first returns
  ["X", "Y", "Z"].forEach((axis, i) => {
    const [least, greatest] = range(columns[axis]);
    file.writeDoubleLE(scale[i], 131 + 8 * i);
    file.writeDoubleLE(offset[i], 155 + 8 * i);
    file.writeDoubleLE(greatest * scale[i] + offset[i], 179 + 16 * i);
    file.writeDoubleLE(least * scale[i] + offset[i], 187 + 16 * i);
  });
  for (let i = 0; i < count; i++) {
    const at = HEADER + i * bytes;
    file.writeInt32LE(columns.X[i], at);
    file.writeInt32LE(columns.Y[i], at + 4);
    file.writeInt32LE(columns.Z[i], at + 8);
    file.writeUInt16LE(columns.intensity[i], at + 12);
    file.writeUInt8(0b001001, at + 14); // return 1 of 1
    file.writeUInt8(columns.classification[i], at + 15);
    if (time !== null) file.writeDoubleLE(columns.time[i], at + time);
    if (colour !== null) ["r", "g", "b"].forEach((c, k) => file.writeUInt16LE(columns[c][i], at + colour + 2 * k));
  }
  writeFileSync(path, file);
}

/** Reads a LAS or LAZ file of point format 0 to 3 as a scan, as `writeLas` takes it. */
export async function readScan(path) {
  const file = readFileSync(path);
  const { scale, offset, pointCount, pointDataOffset, ...header } = Las.Header.parse(file);
  const packed = (file[104] & 0x80) !== 0; // the compressor of LASzip marks the format
  const records = packed ? await Las.PointData.decompressFile(file) : file.subarray(pointDataOffset);
  return { format: header.pointDataRecordFormat, scale, offset, columns: decode(records, header, pointCount) };
}

function decode(records, { pointDataRecordFormat, pointDataRecordLength }, count) {
  const { time, colour } = RECORDS[pointDataRecordFormat];
  const view = new DataView(records.buffer, records.byteOffset, records.byteLength);
  const column = (read) => Float64Array.from({ length: count }, (_, i) => read(i * pointDataRecordLength));
  const columns = {
    X: column((at) => view.getInt32(at, true)),
    Y: column((at) => view.getInt32(at + 4, true)),
    Z: column((at) => view.getInt32(at + 8, true)),
    intensity: column((at) => view.getUint16(at + 12, true)),
    classification: column((at) => view.getUint8(at + 15) & 31), // the upper bits are flags
  };
  if (time !== null) columns.time = column((at) => view.getFloat64(at + time, true));
  if (colour !== null) {
    ["r", "g", "b"].forEach((c, k) => (columns[c] = column((at) => view.getUint16(at + colour + 2 * k, true))));
  }
  return columns;
}

/** Least and greatest number of an array of any length. */
export function range(values) {
  let [least, greatest] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < least) least = value;
    if (value > greatest) greatest = value;
  }
  return [least, greatest];
}
