/** Where things are, as paths: a checkout's folder may have blanks and accents in its name. */

import { fileURLToPath } from "node:url";

/** The folder `web`, and the checkout that it is in. */
export const WEB = fileURLToPath(new URL("..", import.meta.url));
export const CHECKOUT = fileURLToPath(new URL("../..", import.meta.url));
