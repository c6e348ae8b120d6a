//! Pictures of runs beside the reference, within the page.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, html};

use super::{
    study::{Group, Study},
    text::{count, maybe},
};

/// Bytes of a PNG file by the name that records have for it.
pub(super) type Load<'a> = &'a dyn Fn(&str) -> Option<Vec<u8>>;

/// The reference of a group, and picture and error map of each run; `None` if no run names a picture.
pub(super) fn grid(study: &Study<'_>, group: &Group<'_>, load: Load<'_>) -> Option<Markup> {
    let named = |run: usize| {
        let pictures = &study.records[run].pictures;
        [&pictures.image, &pictures.error].map(|name| name.as_deref())
    };
    let reference = group.runs.iter().find_map(|&run| study.records[run].pictures.reference.as_deref());
    if reference.is_none() && group.runs.iter().all(|&run| named(run) == [None, None]) {
        return None;
    }
    let mut missing = 0;
    let mut picture = |name: Option<&str>, alt: String| {
        let bytes = name.and_then(load);
        missing += usize::from(name.is_some() && bytes.is_none());
        bytes.map(|bytes| html! { img src=(format!("data:image/png;base64,{}", STANDARD.encode(bytes))) alt=(alt); })
    };
    let reference = picture(reference, format!("reference of {}", group.title()));
    let runs: Vec<Markup> = group
        .runs
        .iter()
        .filter_map(|&run| {
            let label = &study.labels[run];
            let [image, error] = named(run);
            let image = picture(image, label.clone());
            let error = picture(error, format!("error of {label}"));
            (image.is_some() || error.is_some()).then(|| caption(study, run, &html! { (maybe_picture(image)) (maybe_picture(error)) }))
        })
        .collect();
    Some(html! {
        div.pictures {
            @if let Some(reference) = reference { figure { div.pair { (reference) } figcaption { "reference" } } }
            @for run in runs { (run) }
        }
        @if missing > 0 { p.note { (count(missing, "picture")) " could not be read." } }
    })
}

fn caption(study: &Study<'_>, run: usize, pictures: &Markup) -> Markup {
    html! {
        figure {
            div.pair { (pictures) }
            figcaption {
                strong { (study.labels[run]) } ": " (study.metric().title) " " (maybe(study.error(run))) ", " (study.time_words()) " " (maybe(study.time(run))) " ms"
            }
        }
    }
}

fn maybe_picture(picture: Option<Markup>) -> Markup {
    picture.unwrap_or_else(|| html! { span.none { "no picture" } })
}
