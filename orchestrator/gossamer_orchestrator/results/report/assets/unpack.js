// Bytes in the page become text, and packed arrays become numbers.
async function unpack(id) {
  if (typeof DecompressionStream === "undefined") throw new Error("This browser is older than 2023; the pictures need a newer one.");
  const text = atob(document.getElementById(id).textContent);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

// An array of one dimension is a typed array; one of two is a list of its rows.
function numbers(_, value) {
  if (value === null || typeof value !== "object" || !("bytes" in value && "shape" in value)) return value;
  const text = atob(value.bytes);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const flat = value.kind === "f8" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
  if (value.shape.length === 1) return flat;
  const width = value.shape[1];
  return Array.from({ length: value.shape[0] }, (_, row) => flat.subarray(row * width, (row + 1) * width));
}
