// Unpack, then draw one picture after the other.
async function drawAll() {
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const figure = page.figures.find((each) => each.div === entry.target);
      figure.visible = entry.isIntersecting;
      if (figure.visible) moveFigure(figure);
    }
  });
  const order = [...page.figures.filter((each) => !each.slow), ...page.figures.filter((each) => each.slow)];
  for (const figure of order) {
    await draw(figure);
    seen.observe(figure.div);
    await new Promise((resolve) => setTimeout(resolve));
  }
}

async function main() {
  const status = document.getElementById("status");
  try {
    const [library, data] = await Promise.all([unpack("library"), unpack("data")]);
    document.head.append(element("script", {}, library));
    page.content = JSON.parse(data, numbers);
    addPictures();
    status.textContent = "";
    await drawAll();
    const redraw = () => page.figures.forEach(draw);
    darkness.addEventListener("change", redraw);
    addEventListener("beforeprint", () => { page.printing = true; redraw(); });
    addEventListener("afterprint", () => { page.printing = false; redraw(); });
    document.body.dataset.ready = "yes";
  } catch (error) {
    status.textContent = `The pictures cannot be drawn: ${error.message} The tables below are complete.`;
    throw error;
  }
}

main();
