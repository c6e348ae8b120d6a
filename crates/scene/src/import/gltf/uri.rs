//! URIs: data in themselves, or names of files.

use std::borrow::Cow;

use base64::{
    Engine as _,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};

/// A long URI is not worth showing whole.
pub(super) fn shortened(uri: &str) -> String {
    const LONGEST: usize = 60;
    if uri.chars().count() <= LONGEST { uri.to_owned() } else { uri.chars().take(LONGEST).chain(['…']).collect() }
}

/// The data in a URI, if it is one that holds data.
pub(super) fn data_uri(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let rest = uri.strip_prefix("data:")?;
    Some(match rest.split_once(',') {
        None => Err("a data URI without data".to_owned()),
        Some((head, data)) if head.ends_with(";base64") => {
            let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
            let data: Cow<'_, str> =
                if data.contains('%') { String::from_utf8_lossy(&percent_decoded(data)).into_owned().into() } else { data.into() };
            GeneralPurpose::new(&STANDARD, config).decode(data.as_bytes()).map_err(|error| format!("its base64 data is faulty: {error}"))
        }
        Some((_, data)) => Ok(percent_decoded(data)),
    })
}

/// A URI with `%20` and the like decoded; what is no such code stays as it is.
pub(super) fn percent_decoded(uri: &str) -> Vec<u8> {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let digit = |at: usize| bytes.get(at).and_then(|byte| char::from(*byte).to_digit(16));
        match (bytes[at], digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((16 * high + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                out.push(byte);
                at += 1;
            }
        }
    }
    out
}
