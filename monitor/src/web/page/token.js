// The token that turns knobs: it comes in the address, behind the #, and does not stay there.

const KEY = "mtj.token";

/** The token of this tab, if it was ever given one. */
export function token() {
  const given = /^#token=(.+)$/.exec(location.hash)?.[1];
  if (given) {
    sessionStorage.setItem(KEY, decodeURIComponent(given));
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem(KEY);
}

/** Forgets a token that was refused. */
export function forgetToken() {
  sessionStorage.removeItem(KEY);
}
