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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identities_are_as_long_as_the_release_has_them() {
        let (participant, reader, writer) = ([1; 16], [2; 16], [3; 16]);
        for gid_bytes in [16, 24] {
            let names = ["/", "randt"];
            let bytes =
                participant_entities(gid_bytes, &participant, names, &[reader], &[writer, writer]);
            // Behind the header: an identity, one node, its names padded to four bytes, and two
            // sequences of identities.
            let expected = 4 + gid_bytes + 4 + (4 + 2 + 2) + (4 + 6 + 2) + 4 + gid_bytes + 4;
            assert_eq!(bytes.len(), expected + 2 * gid_bytes);
            assert_eq!(bytes.get(4..20), Some(&participant[..]));
            assert!(bytes.ends_with(&[&[3; 16][..], &vec![0; gid_bytes - 16]].concat()));
        }
    }
}
