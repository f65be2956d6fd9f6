// Reads what the service sends as octets: a line of JSON, then arrays, little endian.

export async function octets(address, signal) {
  const answer = await fetch(address, { signal });
  if (!answer.ok) throw new Error(await reason(answer));
  const content = await answer.arrayBuffer();
  const end = new Uint8Array(content).indexOf(10);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(content, 0, end)));
  const arrays = {};
  let at = end + 1;
  for (const { name, type, shape } of head.arrays) {
    const length = shape.reduce((a, b) => a * b, 1);
    const Kind = type === "<f8" ? Float64Array : Float32Array;
    arrays[name] = { shape, values: new Kind(content, at, length) };
    at += length * Kind.BYTES_PER_ELEMENT;
  }
  return { head, arrays };
}

export async function json(address, signal) {
  const answer = await fetch(address, { signal });
  if (!answer.ok) throw new Error(await reason(answer));
  return answer.json();
}

async function reason(answer) {
  try {
    return (await answer.json()).detail;
  } catch {
    return `${answer.status} ${answer.statusText}`;
  }
}

// Rows of an array of two dimensions, without copies.
export function rows({ shape, values }) {
  const width = shape[shape.length - 1];
  return Array.from({ length: values.length / width }, (_, i) => values.subarray(i * width, (i + 1) * width));
}
