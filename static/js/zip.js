// Reads a zip in the browser (stored and deflated entries), to show programs as text. Format: PKWARE APPNOTE 6.3.

/** Return [{name, size, text()}] of a zip. */
export async function readZip(blob) {
  const bytes = new Uint8Array(await blob.arrayBuffer());
  const view = new DataView(bytes.buffer);
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end -= 1;
  if (end < 0) throw new Error("not a zip");
  const entries = [];
  let at = view.getUint32(end + 16, true);
  for (let i = view.getUint16(end + 10, true); i > 0; i -= 1) {
    if (view.getUint32(at, true) !== 0x02014b50) throw new Error("damaged zip");
    const method = view.getUint16(at + 10, true);
    const packed = view.getUint32(at + 20, true);
    const size = view.getUint32(at + 24, true);
    const nameLength = view.getUint16(at + 28, true);
    const start = view.getUint32(at + 42, true);
    const name = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + nameLength));
    if (!name.endsWith("/")) entries.push({ name, size, text: () => unpack(bytes, view, start, packed, method) });
    at += 46 + nameLength + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
  }
  return entries;
}

async function unpack(bytes, view, start, packed, method) {
  const data = start + 30 + view.getUint16(start + 26, true) + view.getUint16(start + 28, true);
  const body = bytes.subarray(data, data + packed);
  if (method === 0) return new TextDecoder().decode(body);
  if (method !== 8) throw new Error("unknown packing");
  return new Response(new Blob([body]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).text();
}
