// Bytes in the page become text, and packed arrays become numbers.
async function unpack(id) {
  if (typeof DecompressionStream === "undefined") throw new Error("This browser is older than 2023; the pictures need a newer one.");
  const stream = new Blob([bytesOf(document.getElementById(id).textContent)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

function bytesOf(letters) {
  const text = atob(letters), bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes;
}

// An array of one dimension is a typed array; one of two is a list of its rows.
function numbers(_, value) {
  if (value === null || typeof value !== "object" || !("bytes" in value && "shape" in value)) return value;
  const bytes = bytesOf(value.bytes);
  const flat = value.kind === "f8" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
  if (value.shape.length === 1) return flat;
  const width = value.shape[1];
  return Array.from({ length: value.shape[0] }, (_, row) => flat.subarray(row * width, (row + 1) * width));
}
