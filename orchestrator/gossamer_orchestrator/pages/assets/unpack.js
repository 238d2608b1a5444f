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

// An array of one dimension is a typed array; one of two is a list of its rows; one that stands again is the same.
const unpacked = [];
function numbers(_, value) {
  if (value === null || typeof value !== "object") return value;
  if ("same" in value) return unpacked[value.same];
  if (!("bytes" in value && "shape" in value)) return value;
  const { buffer } = bytesOf(value.bytes), width = value.shape[1];
  const flat = value.kind === "f8" ? new Float64Array(buffer) : new Float32Array(buffer);
  const found = width === undefined ? flat : Array.from({ length: value.shape[0] }, (_, row) => flat.subarray(row * width, (row + 1) * width));
  unpacked.push(found);
  return found;
}
