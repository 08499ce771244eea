// Poles of a stabilisation diagram to pick: by mouse, or by arrow keys and Enter; what is picked stands below as a command.
(() => {
  const box = document.currentScript.parentNode;
  const svg = box.querySelector("svg");
  const [out, told] = [box.querySelector(".picked"), box.querySelector(".pointed")];
  const poles = [...svg.querySelectorAll("circle")];
  const place = (pole) => [pole.cx.baseVal.value, pole.cy.baseVal.value];
  const taken = (pole) => pole.classList.contains("taken");
  const toggle = (pole) => {
    pole.classList.toggle("taken");
    const picked = poles.filter(taken).map((p) => [+p.dataset.f, +p.dataset.z]).sort((a, b) => a[0] - b[0]);
    const words = picked.map(([f, z]) => ` --pole ${f}:${z}`).join("");
    out.textContent = words ? svg.dataset.command + words : "nothing yet";
  };
  let at = null;
  const go = (pole) => {
    at?.classList.remove("at");
    at = pole;
    at.classList.add("at");
    told.textContent = `${at.textContent}, ${taken(at) ? "picked" : "not picked"}`;
  };
  // The nearest pole in the direction, within 45° of it where there is one.
  const nearest = (right, down) => {
    const [x, y] = place(at);
    const ways = poles.map((pole) => {
      const [dx, dy] = [place(pole)[0] - x, place(pole)[1] - y];
      const [along, across] = right ? [right * dx, Math.abs(dy)] : [down * dy, Math.abs(dx)];
      return { pole, along, across, far: across > along };
    }).filter(({ along }) => along > (right ? 1 : 0.1));
    ways.sort((a, b) => a.far - b.far || a.along + 2 * a.across - b.along - 2 * b.across);
    return ways[0]?.pole;
  };
  svg.addEventListener("click", ({ target }) => target.matches("circle") && toggle(target));
  svg.addEventListener("focus", () => svg.matches(":focus-visible") && go(at ?? poles.at(-1)));
  svg.addEventListener("blur", () => at?.classList.remove("at"));
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  svg.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !(steps[event.key] || [" ", "Enter"].includes(event.key))) return;
    at ??= poles.at(-1);
    if (steps[event.key]) go(nearest(...steps[event.key]) ?? at);
    else {
      toggle(at);
      go(at);
    }
    event.preventDefault();
  });
})();
