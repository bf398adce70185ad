//! Figures in pages: what stands between two marks is replaced.

/// The page with everything between the marks `<!-- NAME:begin -->` and `<!-- NAME:end -->` replaced.
///
/// # Errors
/// When the marks are not both there, in order.
pub(crate) fn splice(page: &str, name: &str, figures: &str) -> Result<String, String> {
    let (begin_mark, end_mark) = (format!("<!-- {name}:begin -->"), format!("<!-- {name}:end -->"));
    let missing = || format!("the page has no `{begin_mark}` followed by `{end_mark}`");
    let begin = page.find(&begin_mark).ok_or_else(missing)? + begin_mark.len();
    let end = begin + page[begin..].find(&end_mark).ok_or_else(missing)?;
    Ok(format!("{}\n\n{}\n\n{}", &page[..begin], figures.trim(), &page[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_between_the_marks_changes() {
        let (begin, end) = ("<!-- speed:begin -->", "<!-- speed:end -->");
        let page = format!("# Speed\n\n{begin}\nold\n{end}\n\nAfter.\n");
        let once = splice(&page, "speed", "new\n").expect("marks");
        assert_eq!(once, format!("# Speed\n\n{begin}\n\nnew\n\n{end}\n\nAfter.\n"));
        assert_eq!(splice(&once, "speed", "new"), Ok(once.clone()), "a second time changes nothing");
        assert!(splice("no marks", "speed", "new").is_err());
        assert!(splice(&page, "size", "new").is_err(), "marks of another name");
        assert!(splice(&format!("{end} {begin}"), "speed", "new").is_err());
    }
}
