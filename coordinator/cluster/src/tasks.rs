//! Numbers of tasks, as queues write them: `7`, `1-4`, `5-48:1`, `1,3-9:2%4`.

/// Most tasks of one list: more than any queue takes.
const TASKS_MAX: usize = 1 << 20;

/// The numbers of a list; `None` where it is none.
pub(crate) fn numbers(text: &str) -> Option<Vec<u32>> {
    // How many of them may run at a time stands behind a %.
    let text = text.split_once('%').map_or(text, |(list, _)| list);
    let text = text.trim_start_matches('[').trim_end_matches(']');
    let mut numbers = Vec::new();
    for part in text.split(',') {
        let (range, step) = part.split_once(':').unwrap_or((part, "1"));
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let (first, last): (u32, u32) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
        let step: usize = step.trim().parse().ok().filter(|&step| step > 0)?;
        let range = (first..=last).step_by(step);
        if numbers.len() + range.clone().count() > TASKS_MAX {
            return None;
        }
        numbers.extend(range);
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_as_queues_write_them() {
        for (text, expected) in [
            ("7", vec![7]),
            ("1-4", vec![1, 2, 3, 4]),
            ("5-8:1", vec![5, 6, 7, 8]),
            ("1,3-9:2%4", vec![1, 3, 5, 7, 9]),
            ("[2-3]", vec![2, 3]),
        ] {
            assert_eq!(numbers(text), Some(expected), "{text}");
        }
        for wrong in ["", "a", "1-", "1-9:0", "N/A", "1-4,...", "0-4294967295"] {
            assert_eq!(numbers(wrong), None, "{wrong}");
        }
    }
}
