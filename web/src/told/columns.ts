/** Columns as `pomona/viewer/packed_columns.py` packs them. */
export interface Packed {
  readonly n: number;
  /** In whole steps. */
  readonly low: number;
  readonly step: number;
  readonly bytes: string;
}

export async function unpacked(column: Packed): Promise<Float64Array> {
  const planes = await inflated(column.bytes);
  const { n, low, step } = column;
  const values = new Float64Array(n);
  let code = 0;
  for (let i = 0; i < n; i++) {
    const folded = (planes[i] | (planes[n + i] << 8) | (planes[2 * n + i] << 16) | (planes[3 * n + i] << 24)) >>> 0;
    code += folded % 2 ? -(folded + 1) / 2 : folded / 2;
    values[i] = code === 0 ? NaN : (low + code - 1) * step;
  }
  return values;
}

export async function unpackedTexts(packed: string): Promise<string[]> {
  return JSON.parse(new TextDecoder().decode(await inflated(packed))) as string[];
}

async function inflated(base64: string): Promise<Uint8Array> {
  const deflated = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
