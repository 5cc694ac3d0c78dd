//! `rmw_dds_common/ParticipantEntitiesInfo`: by which the tools of ROS 2 know whose a topic is.

use crate::pen::{Pen, Style};

/// Identifies a participant, a reader or a writer of DDS.
pub type Gid = [u8; 16];

/// A node with its readers and writers, the only one of its participant. `gid_bytes`: 24 up to
/// Humble, 16 since Iron.
pub fn participant_entities(
    gid_bytes: usize,
    participant: &Gid,
    [namespace, name]: [&str; 2],
    readers: &[Gid],
    writers: &[Gid],
) -> Vec<u8> {
    let padding = vec![0; gid_bytes.saturating_sub(participant.len())];
    let mut pen = Pen::new(Style::Cdr);
    let gid = |pen: &mut Pen, gid: &Gid| {
        pen.bare(gid);
        pen.bare(&padding);
    };
    gid(&mut pen, participant);
    pen.u32(1);
    pen.string(namespace);
    pen.string(name);
    for gids in [readers, writers] {
        pen.u32(gids.len() as u32);
        for it in gids {
            gid(&mut pen, it);
        }
    }
    pen.end()
}
