"""Reads RON as far as machine files need it: structs become dicts, tuples and lists become lists, words become strings."""
import re

TOKEN = re.compile(r'\s*(?://[^\n]*\s*)*([-+]?\d[\d_]*\.?\d*(?:[eE][-+]?\d+)?|"(?:[^"\\]|\\.)*"|[A-Za-z_]\w*|[()\[\]{}:,])')


def read(text):
    """A value of the text; a struct with a name keeps it under `_`."""
    tokens, at = [], 0
    while found := TOKEN.match(text, at):
        tokens.append(found[1])
        at = found.end()
    value, end = _value(tokens, 0)
    if end != len(tokens):
        raise ValueError(f"RON text goes on after its value at {tokens[end]!r}")
    return value


def _value(tokens, i):
    token = tokens[i]
    if token in "([{":
        return _inside(tokens, i + 1, {"(": ")", "[": "]", "{": "}"}[token])
    if token[0] == '"':
        return token[1:-1], i + 1
    if token[0].isalpha() or token[0] == "_":
        if i + 1 < len(tokens) and tokens[i + 1] == "(":
            value, end = _inside(tokens, i + 2, ")")
            return ({"_": token} | value if isinstance(value, dict) else {"_": token, "values": value}), end
        return {"true": True, "false": False}.get(token, token), i + 1
    return float(token.replace("_", "")), i + 1


def _inside(tokens, i, closing):
    fields, values = {}, []
    while tokens[i] != closing:
        value, i = _value(tokens, i)
        if tokens[i] == ":":
            fields[value], i = _value(tokens, i + 1)
        else:
            values.append(value)
        if tokens[i] == ",":
            i += 1
    return (fields if fields or closing == "}" else values), i + 1
