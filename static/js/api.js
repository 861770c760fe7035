// REST under api/v1, relative to where the page is served, so that a prefix or a proxy does not matter.

export const API = "api/v1";

/** A refusal of the server, in its own words. */
export class ApiError extends Error {
  constructor(status, issues) {
    super(issues.map((i) => i.message).join(" "));
    this.status = status;
    this.issues = issues;
  }
}

/** Issues of any answer that is not ok. */
function issuesOf(status, body) {
  if (Array.isArray(body?.error?.issues) && body.error.issues.length) return body.error.issues;
  if (Array.isArray(body?.issues) && body.issues.length) return body.issues;
  if (body?.error) return [{ severity: "error", code: "refused", remedy: "", where: "", ...body.error }];
  if (Array.isArray(body?.detail)) return body.detail.map((d) => ({ severity: "error", code: "invalid", message: d.msg, remedy: "", where: (d.loc ?? []).slice(1).join(".") }));
  return [{ severity: "error", code: `http-${status}`, message: `The server answered ${status}.`, remedy: "Try again.", where: "" }];
}

const tags = new Map();
/** The ETag last seen of a resource. */
export const etagOf = (path) => tags.get(path) ?? null;

/** One request; returns the JSON (or null). Network failures become an ApiError too. */
export async function call(method, path, body, headers = {}, within_ms = null) {
  let answer;
  try {
    answer = await fetch(`${API}${path}`, {
      method,
      credentials: "same-origin",
      headers: { Accept: "application/json", ...(body === undefined ? {} : { "Content-Type": "application/json" }), ...headers },
      body: body === undefined ? undefined : JSON.stringify(body),
      signal: within_ms === null ? undefined : AbortSignal.timeout(within_ms),
    });
  } catch {
    throw new ApiError(0, [{ severity: "error", code: "offline", message: "The server cannot be reached.", remedy: "The page reconnects by itself.", where: "" }]);
  }
  const tag = answer.headers.get("ETag");
  if (tag) tags.set(path, tag);
  const text = await answer.text();
  let parsed = null;
  try { parsed = text ? JSON.parse(text) : null; } catch { /* not JSON: the status says it all */ }
  if (!answer.ok) throw new ApiError(answer.status, issuesOf(answer.status, parsed));
  return parsed;
}

export const get = (path, within_ms = null) => call("GET", path, undefined, {}, within_ms);
export const post = (path, body = {}) => call("POST", path, body);
/** PUT guarded by the ETag seen last, so that nobody overwrites what he has not seen. */
export const put = (path, body) => call("PUT", path, body, tags.has(path) ? { "If-Match": tags.get(path) } : {});
export const del = (path) => call("DELETE", path);

/** Upload files as multipart, streamed by the browser from disk; onProgress(fraction, sentBytes, totalBytes). */
export function upload(method, path, files, fields = {}, onProgress = () => {}) {
  const form = new FormData();
  for (const [name, value] of Object.entries(fields)) if (value !== null && value !== undefined && value !== "") form.append(name, value);
  for (const [name, file] of files) form.append(name, file, file.name);
  const request = new XMLHttpRequest();
  const promise = new Promise((resolve, reject) => {
    request.open(method, `${API}${path}`);
    request.responseType = "text";
    request.setRequestHeader("Accept", "application/json");
    request.upload.onprogress = (e) => e.lengthComputable && onProgress(e.loaded / e.total, e.loaded, e.total);
    request.onload = () => {
      let parsed = null;
      try { parsed = JSON.parse(request.responseText); } catch { /* as above */ }
      if (request.status >= 200 && request.status < 300) resolve(parsed);
      else reject(new ApiError(request.status, issuesOf(request.status, parsed)));
    };
    request.onerror = () => reject(new ApiError(0, [{ severity: "error", code: "upload-broken", message: "The upload was interrupted.", remedy: "Upload the file again.", where: "" }]));
    request.onabort = () => reject(new ApiError(0, [{ severity: "info", code: "upload-cancelled", message: "The upload was cancelled.", remedy: "", where: "" }]));
    request.send(form);
  });
  return { promise, cancel: () => request.abort() };
}

/** Address of a download. */
export const href = (path) => `${API}${path}`;
