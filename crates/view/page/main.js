// Shows what the datasets say of themselves.
const config = JSON.parse(document.getElementById("config").textContent);
const out = document.getElementById("scene");
for (const scene of config.mode === "server" ? config.scenes : []) {
    const answer = await fetch(`${scene}/scene`);
    out.textContent += JSON.stringify(await answer.json(), null, 2) + "\n";
}
