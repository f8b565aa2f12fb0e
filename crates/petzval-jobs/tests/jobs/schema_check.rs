//! A check of a value against a JSON Schema, for the words that the schemas of this program use.

use serde_json::Value;

/// Checks a value against a schema whose definitions stand in `root`. The error names the place and what is wrong there. A word of JSON Schema that is
/// not known here is an error too, so that nothing is passed unread.
pub fn check(schema: &Value, root: &Value, value: &Value, at: &str) -> Result<(), String> {
    let Value::Object(words) = schema else {
        return if *schema == Value::Bool(true) { Ok(()) } else { Err(format!("{at}: nothing may be here")) };
    };
    let wrong = |what: String| Err(format!("{at}: {what}, not {value}"));
    for (word, says) in words {
        match word.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" | "examples" => {}
            "$ref" => {
                let name = says.as_str().unwrap();
                let place = name.strip_prefix('#').unwrap();
                let schema = root.pointer(place).ok_or_else(|| format!("{at}: no {name}"))?;
                check(schema, root, value, at)?;
            }
            "type" => {
                let one = [says.clone()];
                let types = says.as_array().map_or(&one[..], Vec::as_slice);
                if !types.iter().any(|name| is_of_type(value, name.as_str().unwrap())) {
                    return wrong(format!("a value of type {says}"));
                }
            }
            "enum" if !says.as_array().unwrap().contains(value) => return wrong(format!("one of {says}")),
            "const" if says != value => return wrong(says.to_string()),
            "minimum" if value.as_f64().is_some_and(|number| number < says.as_f64().unwrap()) => {
                return wrong(format!("{says} at least"));
            }
            "maximum" if value.as_f64().is_some_and(|number| number > says.as_f64().unwrap()) => {
                return wrong(format!("{says} at most"));
            }
            "minItems" if value.as_array().is_some_and(|a| (a.len() as u64) < says.as_u64().unwrap()) => {
                return wrong(format!("{says} values at least"));
            }
            "maxItems" if value.as_array().is_some_and(|a| a.len() as u64 > says.as_u64().unwrap()) => {
                return wrong(format!("{says} values at most"));
            }
            "enum" | "const" | "minimum" | "maximum" | "minItems" | "maxItems" | "uniqueItems" => {}
            "anyOf" | "oneOf" => {
                let all = says.as_array().unwrap();
                let errors: Vec<String> =
                    all.iter().filter_map(|one| check(one, root, value, at).err()).collect();
                if errors.len() == all.len() {
                    return Err(errors.join(" | "));
                }
            }
            "allOf" => {
                for one in says.as_array().unwrap() {
                    check(one, root, value, at)?;
                }
            }
            "required" => {
                for key in says.as_array().unwrap().iter().filter_map(Value::as_str) {
                    if value.is_object() && value.get(key).is_none() {
                        return wrong(format!("`{key}` is required"));
                    }
                }
            }
            "properties" => {
                for (key, schema) in says.as_object().unwrap() {
                    if let Some(inner) = value.get(key) {
                        check(schema, root, inner, &format!("{at}.{key}"))?;
                    }
                }
            }
            "additionalProperties" | "unevaluatedProperties" => {
                let known = words.get("properties").and_then(Value::as_object);
                for (key, inner) in value.as_object().into_iter().flatten() {
                    if known.is_none_or(|known| !known.contains_key(key)) {
                        check(says, root, inner, &format!("{at}.{key}"))?;
                    }
                }
            }
            "items" => {
                let first = words.get("prefixItems").and_then(Value::as_array).map_or(0, Vec::len);
                for (i, inner) in value.as_array().into_iter().flatten().enumerate().skip(first) {
                    check(says, root, inner, &format!("{at}[{i}]"))?;
                }
            }
            "prefixItems" => {
                let all = says.as_array().unwrap();
                for (i, (schema, inner)) in all.iter().zip(value.as_array().into_iter().flatten()).enumerate()
                {
                    check(schema, root, inner, &format!("{at}[{i}]"))?;
                }
            }
            other => return Err(format!("{at}: `{other}` is not known to this check")),
        }
    }
    Ok(())
}

fn is_of_type(value: &Value, name: &str) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.as_f64().is_some_and(|number| number.fract() == 0.0),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => false,
    }
}
