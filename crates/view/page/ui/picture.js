// The picture as a file.

/** Gives the person the canvas as PNG. */
export function savePicture(app) {
  app.frame(); // what is on the canvas is gone after the frame
  app.canvas.toBlob((blob) => {
    if (!blob) return app.messages.fail("The picture cannot be saved: the graphics card gave it up.");
    const a = document.createElement("a");
    a.href = URL.createObjectURL(blob);
    a.download = `${app.clouds[0]?.scene.name ?? "pointmill"}.png`;
    a.click();
    setTimeout(() => URL.revokeObjectURL(a.href), 1000);
  }, "image/png");
}
