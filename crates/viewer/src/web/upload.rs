//! Files from a browser: one, or a scene with what it refers to.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::{Query, Request, State};
use axum::http::{StatusCode, header};
use axum::response::Response;

use super::{App, Parameters, refuse};
use crate::host::Source;
use crate::session::locked;

/// Most files at once, and longest name of one, letters.
const MAX_FILES: usize = 1000;
const MAX_NAME: usize = 300;

/// A file becomes the scene. Nothing of it is taken in before it is known who sends it.
pub(super) async fn upload(
    State(app): State<Arc<App>>,
    query: Query<Parameters>,
    request: Request,
) -> Response {
    if let Err(reason) = app.access.check(request.headers(), &query.token) {
        return refuse(StatusCode::FORBIDDEN, reason);
    }
    if !locked(&app.viewers).holds(&query.key) {
        return refuse(StatusCode::FORBIDDEN, "only the viewer who holds the controls can open a scene");
    }
    let Ok(_turn) = app.uploading.try_acquire() else {
        return refuse(
            StatusCode::TOO_MANY_REQUESTS,
            "another file is being sent; try again when it is there",
        );
    };
    let too_large = || refuse(StatusCode::PAYLOAD_TOO_LARGE, "the file is too large");
    let length = request.headers().get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok());
    if length.and_then(|length| length.parse().ok()).is_some_and(|length: usize| length > app.upload_bytes) {
        return too_large();
    }
    let Ok(body) = axum::body::to_bytes(request.into_body(), app.upload_bytes).await else {
        return too_large();
    };
    // A name tells the format and is shown; it never becomes a path.
    let name: String = query.name.rsplit(['/', '\\']).next().unwrap_or("").chars().take(200).collect();
    let name = if name.is_empty() { "upload".into() } else { name };
    let source = if query.several {
        match unpack(&body) {
            Ok((bytes, beside)) => Source::Upload { name, bytes, beside },
            Err(reason) => return refuse(StatusCode::BAD_REQUEST, reason),
        }
    } else {
        Source::Upload { name, bytes: Arc::from(&body[..]), beside: BTreeMap::new() }
    };
    app.session.open(source);
    refuse(StatusCode::ACCEPTED, "opening")
}

/// A scene, and what came with it by paths.
type Files = (Arc<[u8]>, BTreeMap<String, Arc<[u8]>>);

/// Several files: the length of a JSON header (four bytes, little-endian), the header, which lists names and sizes, and the
/// files one after the other; the first is the scene, the others are called as it may refer to them.
fn unpack(body: &[u8]) -> Result<Files, &'static str> {
    let broken = "the files are not packed as they should be";
    let (length, rest) = body.split_at_checked(4).ok_or(broken)?;
    let length = u32::from_le_bytes(length.try_into().map_err(|_| broken)?) as usize;
    let (header, mut rest) = rest.split_at_checked(length).ok_or(broken)?;
    let list: Vec<(String, usize)> = serde_json::from_slice(header).map_err(|_| broken)?;
    if list.len() > MAX_FILES || list.iter().any(|(name, _)| name.len() > MAX_NAME) {
        return Err("too many files, or too long a name");
    }
    let mut files = Vec::new();
    for (name, size) in list {
        let (bytes, after) = rest.split_at_checked(size).ok_or(broken)?;
        files.push((name, Arc::from(bytes)));
        rest = after;
    }
    if !rest.is_empty() || files.is_empty() {
        return Err(broken);
    }
    let (_, scene) = files.remove(0);
    Ok((scene, files.into_iter().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_files_are_told_apart() {
        let pack = |header: &str, data: &[u8]| {
            let mut body = (header.len() as u32).to_le_bytes().to_vec();
            body.extend_from_slice(header.as_bytes());
            body.extend_from_slice(data);
            body
        };
        let header = r#"[["a.gltf",2],["img/b.png",3]]"#;
        let (scene, beside) = unpack(&pack(header, b"xxyyy")).expect("whole");
        assert_eq!((&scene[..], &beside["img/b.png"][..]), (&b"xx"[..], &b"yyy"[..]));
        for (header, data) in [
            (header, &b"xxyy"[..]),
            (header, b"xxyyyz"),
            ("[]", b""),
            ("{}", b""),
            (r#"[["a",18446744073709551615]]"#, b"x"),
            (r#"[["a",-1]]"#, b"x"),
        ] {
            assert!(unpack(&pack(header, data)).is_err(), "{header}");
        }
        assert!(unpack(b"").is_err() && unpack(&[255; 9]).is_err());
    }
}
