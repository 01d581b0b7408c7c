/** The elements of `index.html`, by their ids, of the types that they have there. */

export function element<Type extends HTMLElement>(id: string, type: new () => Type): Type {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new Error(`the page has no ${type.name} #${id}`);
  return found;
}

export const button = (id: string) => element(id, HTMLButtonElement);
export const input = (id: string) => element(id, HTMLInputElement);
export const select = (id: string) => element(id, HTMLSelectElement);
export const output = (id: string) => element(id, HTMLOutputElement);
export const canvas = (id: string) => element(id, HTMLCanvasElement);
export const anyElement = (id: string) => element(id, HTMLElement);
