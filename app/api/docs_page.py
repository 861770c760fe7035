"""`/docs`: the API as one page made from its own OpenAPI document. No script, nothing from outside."""

import json
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>EchoBase REST</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body{font:15px/1.5 system-ui,sans-serif;margin:0 auto;max-width:60rem;padding:1.5rem;color:#1b1f24;background:#fff}
h1{font-size:1.4rem}h2{font-size:1.1rem;margin:2.5rem 0 .5rem;border-bottom:1px solid #d0d7de}
details{border:1px solid #d0d7de;border-radius:6px;margin:.4rem 0;padding:.4rem .8rem}summary{cursor:pointer}
code,pre{font:13px/1.45 ui-monospace,monospace}pre{background:#f6f8fa;padding:.7rem;overflow:auto;border-radius:6px}
.m{display:inline-block;min-width:4.5rem;font-weight:600}
table{border-collapse:collapse}td{padding:.1rem .8rem .1rem 0;vertical-align:top}
</style></head><body>
<h1>{{ info.title }} {{ info.version }}</h1>
<p>{{ info.description }}</p>
<p>Machine-readable: <a href="/openapi.json"><code>/openapi.json</code></a> (OpenAPI {{ openapi }}).</p>
{% for tag, operations in groups.items() %}<h2>{{ tag }}</h2>
{% for o in operations %}<details id="{{ o.id }}">
<summary><span class="m">{{ o.method }}</span><code>{{ o.path }}</code></summary>
<p>{{ o.text }}</p>
{% if o.parameters %}<table>{% for p in o.parameters %}<tr><td><code>{{ p.name }}</code></td><td>{{ p.place }}</td>
<td>{{ p.text }}</td></tr>{% endfor %}</table>{% endif %}
<pre>{{ o.curl }}</pre>
{% if o.answer %}<p>Answer {{ o.status }}, for example:</p><pre>{{ o.answer }}</pre>{% endif %}
<table>{% for status, text in o.errors %}<tr><td><code>{{ status }}</code></td><td>{{ text }}</td></tr>{% endfor %}</table>
</details>{% endfor %}{% endfor %}
</body></html>"""


def docs_page(api: dict[str, Any], base: str) -> str:
    """Return the HTML of an OpenAPI document; `base` is where the server is, for the curl lines."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for path, methods in api["paths"].items():
        for method, operation in methods.items():
            tag = (operation.get("tags") or ["other"])[0]
            groups.setdefault(tag, []).append(_operation(api, base, path, method.upper(), operation))
    template = Environment(autoescape=True).from_string(_PAGE)
    return Markup(template.render(groups=groups, info=api["info"], openapi=api["openapi"]))  # noqa: S704 - autoescaped above


def _operation(api: dict[str, Any], base: str, path: str, method: str, operation: dict[str, Any]) -> dict[str, Any]:
    status, good = next((s, r) for s, r in sorted(operation["responses"].items()) if s < "400")
    answer = (good.get("content") or {}).get("application/json", {}).get("schema")
    errors = [(s, r["description"]) for s, r in sorted(operation["responses"].items()) if s >= "400"]
    return {
        "id": operation["operationId"],
        "method": method,
        "path": path,
        "text": operation.get("description", operation.get("summary", "")),
        "parameters": [
            {"name": p["name"], "place": p["in"], "text": p.get("description", "")}
            for p in operation.get("parameters", [])
        ],
        "curl": _curl(api, base, path, method, operation),
        "status": status,
        "answer": json.dumps(example(api, answer), indent=1, ensure_ascii=False) if answer else "",
        "errors": errors,
    }


def _curl(api: dict[str, Any], base: str, path: str, method: str, operation: dict[str, Any]) -> str:
    content = (operation.get("requestBody") or {}).get("content", {})
    line = "curl" if method == "GET" else f"curl -X {method}"
    if "multipart/form-data" in content:
        fields = content["multipart/form-data"]["schema"]["properties"]
        line += "".join(
            f" -F {name}={'@FILE' if name == 'file' else p.get('example', '')}" for name, p in fields.items()
        )
    elif "application/json" in content:
        media = content["application/json"]
        body = json.dumps(example(api, media["schema"]), ensure_ascii=False)
        line += f" -H 'Content-Type: application/json' -d '{body}'"
    return f"{line} {base}{path}"


def example(api: dict[str, Any], schema: dict[str, Any], depth: int = 0) -> Any:
    """Return an example of a JSON schema: its own where it has one, its default, or the simplest value of its type."""
    if "$ref" in schema:
        return example(api, api["components"]["schemas"][schema["$ref"].rsplit("/", 1)[-1]], depth)
    for key in ("examples", "example", "const", "default", "enum"):
        if key in schema:
            return schema[key][0] if key in ("examples", "enum") else schema[key]
    for key in ("anyOf", "oneOf", "allOf"):
        if key in schema:
            return example(api, schema[key][0], depth)
    kind = schema.get("type")
    if kind == "object" and depth < 6:
        return {name: example(api, sub, depth + 1) for name, sub in schema.get("properties", {}).items()}
    if kind == "array" and depth < 6:
        return [example(api, schema.get("items", {}), depth + 1)]
    return {"string": "text", "integer": 1, "number": 0.0, "boolean": False}.get(str(kind))
