//! Plans as pictures, nodes as pages.

use manylight_graph::reference;

use crate::kit::*;

#[test]
fn a_plan_as_graphviz_and_mermaid() {
    let plan = try_plan(&files(), &input()).unwrap();
    let dot = plan.to_dot();
    for part in ["digraph plan {", "label=\"test\"", "\"paint\" -> \"soft\" [label=\"picture\"];", "\"hard\" [style=dashed"] {
        assert!(dot.contains(part), "{part}\n{dot}");
    }
    let mermaid = plan.to_mermaid();
    for part in ["flowchart TB", "subgraph stage_test", "paint -->|picture| soft", "soft -->|blurred| show"] {
        assert!(mermaid.contains(part), "{part}\n{mermaid}");
    }
}

#[test]
fn a_plan_as_json() {
    let json = try_plan(&files(), &input()).unwrap().to_json();
    assert_eq!(json["nodes"][2]["id"], "soft");
    assert_eq!(json["nodes"][2]["bindings"]["source"], "picture");
    assert_eq!(json["nodes"][3]["bindings"]["mask"], serde_json::Value::Null);
    assert_eq!(json["nodes"][0]["steps"][0]["groups"], serde_json::json!([4, 1, 1]));
    assert_eq!(json["idle"][0]["state"], "dead");
    assert_eq!(json["presents"], "result");
}

#[test]
fn a_plan_as_svg_has_every_node_once_and_apart() {
    let svg = try_plan(&files(), &input()).unwrap().to_svg();
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
    for id in ["paint", "pyramid", "soft", "show"] {
        assert_eq!(svg.matches(&format!("font-weight=\"bold\" text-anchor=\"middle\">{id}<")).count(), 1, "{svg}");
    }
    assert!(svg.contains("hard: blur is on"));
    let boxes: Vec<(f64, f64)> = svg
        .split("<rect x=\"")
        .skip(1)
        .filter(|r| r.contains("width=\"190\""))
        .map(|r| {
            let mut numbers = r.split('"');
            (numbers.next().unwrap().parse().unwrap(), numbers.nth(1).unwrap().parse().unwrap())
        })
        .collect();
    assert_eq!(boxes.len(), 4);
    for (i, a) in boxes.iter().enumerate() {
        for b in &boxes[i + 1..] {
            assert!((a.0 - b.0).abs() >= 190.0 || (a.1 - b.1).abs() >= 40.0, "{a:?} lies on {b:?}");
        }
    }
}

#[test]
fn nodes_as_pages() {
    let (registry, _) = registry(&files(), &[]);
    let page = reference::markdown(&registry);
    for part in [
        "## draw\n",
        "### draw/paint\n",
        "| `picture` (out) | a texture Rgba16Float | radiance |",
        "| `strength` | a number from 0.0 to 2.0 | 1.0 | how strong |",
        "| `scene_camera` |",
    ] {
        assert!(page.contains(part), "{part}\n{page}");
    }
    assert!(reference::text(&registry).contains("post/blur     Blurs.\n"));
    let node = reference::find(&registry, "post/blur").unwrap();
    assert!(reference::node_text(node).contains("  mask    a texture R32Float, optional. where"));
    assert_eq!(reference::json(&registry)["nodes"][0]["params"]["mode"]["options"][1], "mean");
    let fault = reference::find(&registry, "post/blurr").unwrap_err();
    assert_eq!(fault.help.as_deref(), Some("did you mean `post/blur`?"));
}
