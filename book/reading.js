// What scrolls can be reached by the keyboard; what the reader types stands out from what the program answers.
document.querySelectorAll("main pre code, main .equation, main .table-wrapper").forEach((part) => { part.tabIndex = 0; });
document.querySelectorAll("main code.console").forEach((block) => {
    let goesOn = false;
    const lines = block.textContent.split("\n").map((line) => {
        const typed = goesOn || line.startsWith("$ ");
        goesOn = typed && line.endsWith("\\");
        const part = document.createElement(typed ? "b" : "span");
        part.textContent = line;
        return part;
    });
    block.replaceChildren(...lines.flatMap((part) => [part, "\n"]).slice(0, -1));
});
