// One picture of a cloud, from the same side in all clients, and where its colours are.

/** Places `camera` so that it sees the box `[min, max]` from the south-east and above. */
export function look(camera, [min, max]) {
  const middle = min.map((value, axis) => (value + max[axis]) / 2);
  const radius = Math.max(Math.hypot(...min.map((value, axis) => max[axis] - value)) / 2, 1e-3);
  const distance = (radius / Math.sin((camera.fov * Math.PI) / 360)) * 1.05;
  const direction = [0.55, -0.7, 0.45].map((value) => value / Math.hypot(0.55, -0.7, 0.45));
  camera.up.set(0, 0, 1);
  camera.position.set(...middle.map((value, axis) => value + direction[axis] * distance));
  camera.near = distance / 100;
  camera.far = distance * 3;
  camera.lookAt(...middle);
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}

/**
 * What is in the picture: the part that is not background (the colour of its first pixel, where no cloud is), the brightest
 * channel of that, and for each ball the pixels of its colour, the middle of them and their mean colour.
 */
export function measure(canvas, balls) {
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
  const found = balls.map(() => ({ pixels: 0, x: 0, y: 0, colour: [0, 0, 0] }));
  let [drawn, brightest] = [0, 0];
  for (let i = 0; i < data.length; i += 4) {
    const pixel = [data[i], data[i + 1], data[i + 2]];
    if (pixel.every((value, k) => value === data[k])) continue;
    drawn += 1;
    brightest = Math.max(brightest, ...pixel);
    balls.forEach((ball, k) => {
      if (!resembles(pixel, ball.colour)) return;
      found[k].pixels += 1;
      found[k].x += (i / 4) % canvas.width;
      found[k].y += Math.floor(i / 4 / canvas.width);
      pixel.forEach((value, c) => (found[k].colour[c] += value));
    });
  }
  for (const ball of found) {
    ball.x /= ball.pixels;
    ball.y /= ball.pixels;
    ball.colour = ball.colour.map((sum) => sum / ball.pixels);
  }
  return { drawn: drawn / (canvas.width * canvas.height), brightest, balls: found };
}

/** Whether a pixel has the hue of a ball: its greatest channel, and this at least twice the others. */
function resembles(pixel, colour) {
  const main = colour.indexOf(Math.max(...colour));
  return pixel[main] > 60 && pixel.every((value, k) => k === main || 2 * value < pixel[main]);
}

/** Where the middles of the balls are in the picture, and their radius, in pixels. */
export function project(camera, canvas, balls, Vector3) {
  const right = new Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
  const pixel = (world) => {
    const point = world.clone().project(camera);
    return [((point.x + 1) / 2) * canvas.width, ((1 - point.y) / 2) * canvas.height];
  };
  return balls.map(({ centre, radius }) => {
    const middle = new Vector3(...centre);
    const [x, y] = pixel(middle);
    const [edge] = pixel(middle.clone().addScaledVector(right, radius));
    return { x, y, radius: Math.abs(edge - x) };
  });
}
