//! What is known of a rendered frame, as JSON for scripts.

use manylight::{
    fault::Fault,
    gpu::{Image, memory::Holding},
    graph::value::ResourceDesc,
    renderer::Renderer,
};
use serde_json::{Map, Value, json};

/// How a resource holds its memory, in a word.
pub fn holding(holding: Holding) -> String {
    match holding {
        Holding::External => "external".to_owned(),
        Holding::Pool { slot } => format!("pool slot {slot}"),
        Holding::Kept => "kept".to_owned(),
        Holding::Host => "host".to_owned(),
        Holding::History => "history".to_owned(),
    }
}

pub fn memory(renderer: &Renderer) -> Value {
    let report = renderer.memory_report();
    let resources: Vec<Value> =
        report.resources.iter().map(|r| json!({"name": r.name, "bytes": r.bytes, "holding": holding(r.holding)})).collect();
    json!({
        "total": report.total(),
        "pool": report.pool,
        "pool_unshared": report.pool_unshared,
        "skipping": {"on": renderer.settings().skip_unchanged, "bytes": renderer.memory_for_skipping()},
        "history": report.history,
        "kept": report.kept,
        "host": report.host,
        "external": report.external,
        "resources": resources,
    })
}

/// Sums of every named resource: of textures by channel, of buffers by field.
pub fn sums(renderer: &Renderer, names: &[String]) -> Result<Value, Fault> {
    let mut all = Map::new();
    for name in names {
        let plan = renderer.plan();
        let Some(index) = plan.resource(name) else { continue };
        let value = if matches!(plan.resources[index].desc, ResourceDesc::Texture { .. }) {
            sums_of_image(&super::outputs::read(renderer, name)?)
        } else {
            sums_of_elements(&renderer.read_json(name).map_err(|e| Fault::Input(e.to_string()))?)
        };
        all.insert(name.clone(), value);
    }
    Ok(Value::Object(all))
}

fn sums_of_image(image: &Image) -> Value {
    let channels = image.channels.max(1) as usize;
    let of_channel = |channel: usize| {
        let values = || image.data.iter().skip(channel).step_by(channels).map(|v| f64::from(*v));
        let finite = || values().filter(|v| v.is_finite());
        let (count, sum) = (finite().count(), finite().sum::<f64>());
        json!({
            "sum": sum,
            "mean": (count > 0).then(|| sum / count as f64),
            "min": finite().reduce(f64::min),
            "max": finite().reduce(f64::max),
            "non_finite": values().count() - count,
        })
    };
    json!({"width": image.width, "height": image.height, "channels": (0..channels).map(of_channel).collect::<Vec<_>>()})
}

/// The element-wise sum of all elements; arrays and objects are summed member by member.
fn sums_of_elements(elements: &Value) -> Value {
    let Value::Array(elements) = elements else { return elements.clone() };
    let sum = elements.iter().fold(Value::Null, add);
    json!({"elements": elements.len(), "sum": sum})
}

fn add(sum: Value, element: &Value) -> Value {
    match (sum, element) {
        (Value::Null, Value::Object(_)) => add(Value::Object(Map::new()), element),
        (Value::Null, Value::Array(_)) => add(Value::Array(Vec::new()), element),
        (Value::Object(mut sums), Value::Object(members)) => {
            for (name, member) in members {
                let before = sums.remove(name).unwrap_or_default();
                sums.insert(name.clone(), add(before, member));
            }
            Value::Object(sums)
        }
        (Value::Array(mut sums), Value::Array(members)) => {
            sums.resize(sums.len().max(members.len()), Value::Null);
            Value::Array(sums.into_iter().zip(members).map(|(before, member)| add(before, member)).collect())
        }
        (before, member) => {
            let number = |v: &Value| v.as_f64().or_else(|| v.as_bool().map(|b| f64::from(u8::from(b)))).unwrap_or(0.0);
            json!(number(&before) + number(member))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_summed_field_by_field() {
        let elements = json!([{"flux": [1.0, 2.0, 3.0], "n": 4}, {"flux": [0.5, 0.0, "NaN"], "n": 1}]);
        assert_eq!(sums_of_elements(&elements), json!({"elements": 2, "sum": {"flux": [1.5, 2.0, 3.0], "n": 5.0}}));
        assert_eq!(sums_of_elements(&json!([1, 2])), json!({"elements": 2, "sum": 3.0}));
    }

    #[test]
    fn images_are_summed_channel_by_channel() {
        let image = Image { width: 2, height: 1, channels: 2, data: vec![1.0, 5.0, 3.0, f32::NAN] };
        let sums = sums_of_image(&image);
        assert_eq!(sums["channels"][0], json!({"sum": 4.0, "mean": 2.0, "min": 1.0, "max": 3.0, "non_finite": 0}));
        assert_eq!(sums["channels"][1]["non_finite"], 1);
    }
}
