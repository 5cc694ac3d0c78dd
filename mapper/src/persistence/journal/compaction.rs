//! A journal without what its map no longer needs.

use super::keyframe::{AttachedPose, pack_forgotten};
use super::{Error, Kind, Record, Records, read_head, record, records};
use randt_messages::KeyframeHead;

/// What a journal becomes: of these keyframes (numbers rising) no more than their numbers and
/// where they stand, all others as they are, and one snapshot's record for all before.
///
/// The rest of a snapshot's keyframes is needed to come back with its map, and where they stand to
/// make another one by another configuration.
pub(super) fn compact(
    journal: &[u8],
    forgotten: &[(u64, AttachedPose)],
    snapshot: &[u8],
) -> Result<Vec<u8>, Error> {
    let (_, records) = records(journal)?;
    let mut out = journal.get(..records.good()).unwrap_or_default().to_vec();
    keep(records, forgotten, &mut out)?;
    out.extend_from_slice(snapshot);
    Ok(out)
}

fn keep(
    records: Records<'_>,
    forgotten: &[(u64, AttachedPose)],
    out: &mut Vec<u8>,
) -> Result<(), Error> {
    let mut head = KeyframeHead::default();
    for Record { payload, .. } in records.of_kind(Kind::Keyframe) {
        let is_read = read_head(payload, &mut head);
        let found = forgotten.binary_search_by_key(&head.id, |(id, _)| *id);
        let found = found.ok().and_then(|at| forgotten.get(at));
        let is_written = record::append(Kind::Keyframe, out, |out| match found {
            Some((_, attached)) if is_read => pack_forgotten(&head, attached, out),
            _ => out.extend_from_slice(payload),
        });
        is_written.then_some(()).ok_or(Error::TooLarge)?;
    }
    Ok(())
}
