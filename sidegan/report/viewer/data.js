// The page's data: plain values from JSON, arrays from one deflated block.
async function readData() {
  const head = JSON.parse(document.getElementById("data").textContent);
  const text = atob(document.getElementById("arrays").textContent.trim());
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(plain).arrayBuffer();
  const kinds = { uint32: Uint32Array, float32: Float32Array };
  const arrays = {};
  for (const [name, [kind, offset, size]] of Object.entries(head.arrays))
    arrays[name] = new kinds[kind](buffer, offset, size);
  return { ...head, arrays };
}

// A joint's signal as a share of its limit, at a time in samples; linear between samples.
function share(data, name, trajectory, sample, joint) {
  const joints = data.joints.length, row = trajectory * (data.samples + 1);
  const low = Math.min(Math.floor(sample), data.samples - 1), part = sample - low;
  const x = data.arrays[name], at = (row + low) * joints + joint;
  return x[at] * (1 - part) + x[at + joints] * part;
}

function positions(data, trajectory, sample) {
  const { scale } = data.signals.position;
  return data.joints.map((_, j) => data.middle[j] + scale[j] * share(data, "position", trajectory, sample, j));
}

// Name and distance of the closest pair.
function nearest(data, trajectory, sample) {
  if (!data.arrays.distance) return null;
  const row = trajectory * (data.samples + 1);
  const low = Math.min(Math.floor(sample), data.samples - 1), part = sample - low;
  const here = row + Math.min(Math.round(sample), data.samples), { pair, distance } = data.arrays;
  const gap = distance[row + low] * (1 - part) + distance[row + low + 1] * part;
  return { name: data.pairs[pair[here]], distance: gap };
}
