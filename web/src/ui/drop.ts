/** Files that are dropped on the page, wherever. */

/** Begins to listen; of several files the first one is taken. */
export function listenToDrops(open: (file: File) => void): void {
  const { body } = document;
  const show = (isOver: boolean) => body.classList.toggle("dropping", isOver);
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    show(true);
  });
  document.addEventListener("dragleave", () => show(false));
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    show(false);
    const file = event.dataTransfer?.files[0];
    if (file) open(file);
  });
}
