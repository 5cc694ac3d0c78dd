//! Where an estimate meets a map that there was before.

use super::*;

fn keyframe(id: u64, x_m: f64) -> Message<Keyframe> {
    let mut keyframe = Message::<Keyframe>::default();
    keyframe.head.id = id;
    keyframe.head.header.stamp_ns = (id as i64 + 1) * 1_000_000_000;
    keyframe.head.pose = [x_m, 0.0, 0.0];
    keyframe
}

fn joint(is_shown: bool) -> (Joint, Mapper) {
    let mut mapper = Mapper::new(&Config::default());
    (0..3).for_each(|id| _ = mapper.push(keyframe(id, 0.5 * id as f64).as_ref()));
    let refused = 0;
    (Joint { is_shown, refused }, mapper)
}

/// Which of these keyframes the map takes.
fn taken(joint: &mut Joint, mapper: &Mapper, keyframes: &[(u64, f64)]) -> Vec<u64> {
    let takes = |(id, x_m): &&(u64, f64)| joint.takes(mapper, keyframe(*id, *x_m).head.as_ref());
    keyframes.iter().filter(takes).map(|(id, _)| *id).collect()
}

#[test]
fn what_goes_on_is_taken_and_doubles_are_not() {
    let (mut joint, mapper) = joint(true);
    let all = [(1, 0.5), (2, 1.0), (3, 1.5), (4, 2.0)];
    assert_eq!(taken(&mut joint, &mapper, &all), [3, 4]);
    assert_eq!(joint.refused, 0);
}

#[test]
fn an_estimate_that_is_not_known_to_go_on_shows_the_last_keyframe_first() {
    let (mut joint, mapper) = joint(false);
    assert_eq!(taken(&mut joint, &mapper, &[(3, 1.5)]), [0; 0]);
    assert_eq!(taken(&mut joint, &mapper, &[(2, 1.0), (3, 1.5)]), [3]);
    assert_eq!(joint.refused, 1);
}

#[test]
fn another_drives_keyframes_are_refused() {
    let (mut joint, mapper) = joint(true);
    // The last bit of the pose.
    let other = [(2, 1.0_f64.next_up()), (3, 1.5), (4, 2.0)];
    assert_eq!(taken(&mut joint, &mapper, &other), [0; 0]);
    assert_eq!(joint.refused, 2);
}
