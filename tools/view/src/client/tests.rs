//! What a client gets at once, what it is spared, and what waits for the link.

use super::*;
use randt_config::Config;
use randt_messages::{MapperGrid, Message, OdometryState, RadarPoints, Return, TILE_CELLS};

const S: i64 = 1_000_000_000;

fn state(id: i64) -> OdometryState {
    let mut state = OdometryState::default();
    state.header.stamp_ns = 100 * S + id * S / 5;
    state.header.published_ns = state.header.stamp_ns;
    state
}

/// A board with a cloud, a pose, and tiles at the columns.
fn board(columns: &[i32]) -> Board {
    let mut board = Board::new(&Config::default());
    board.take_state(&state(0));
    let mut points = Message::<RadarPoints> {
        items: vec![Return::default(); 2000],
        ..Message::default()
    };
    points.head.sweep.beam_count = 1;
    board.take_points(points.as_ref());
    for column in columns {
        let mut tile = Message::<MapperGrid>::default();
        tile.head.column = *column;
        tile.head.resolution_m = 0.1;
        tile.items = vec![0; TILE_CELLS * TILE_CELLS];
        board.take_tile(tile.as_ref());
    }
    board
}

/// All that goes at once: of messages their subscription, size and text.
fn all(client: &mut Client, board: &Board, flow: &mut Flow, now_ns: i64) -> Vec<(u32, String)> {
    let mut found = Vec::new();
    while let Some(frame) = client.next(board, flow, now_ns) {
        flow.wrote(frame.size());
        if let Frame::Binary(bytes) = frame
            && bytes[0] == 1
        {
            let subscription = u32::from_le_bytes([bytes[1], bytes[2], bytes[3], bytes[4]]);
            found.push((
                subscription,
                String::from_utf8_lossy(&bytes[13..]).into_owned(),
            ));
        }
    }
    found
}

/// Answers everything that is under way, from far away.
fn answer(flow: &mut Flow, now_ns: i64) {
    if let Some(content) = flow.ping(now_ns, true) {
        flow.pong(&content, now_ns + S);
    }
}

fn subscribed(flow: &mut Flow) -> Client {
    let mut client = Client::new("1");
    for _ in 0..20 {
        all(&mut client, &Board::default(), flow, 0);
        answer(flow, 0);
    }
    for topic in ViewerTopic::ALL {
        let (id, channel) = (100 + topic.channel_id(), topic.channel_id());
        client.receive(&format!(
            r#"{{"op":"subscribe","subscriptions":[{{"id":{id},"channelId":{channel}}}]}}"#
        ));
    }
    client
}

#[test]
fn the_most_important_goes_first_and_tiles_by_their_distance() {
    let mut flow = Flow::default();
    let mut client = subscribed(&mut flow);
    let board = board(&[5, -40, 1, 0]);
    let mut got = Vec::new();
    for _ in 0..10 {
        got.extend(all(&mut client, &board, &mut flow, 101 * S));
        answer(&mut flow, 101 * S);
    }
    let order: Vec<_> = got
        .iter()
        .map(|(subscription, _)| *subscription - 100)
        .collect();
    assert_eq!(order[..6], [1, 2, 3, 4, 5, 6]);
    // Four quarters of four tiles, without detail first, and again with it.
    assert_eq!(order[6..], [8; 32]);
    let columns = [0, 1, 5, -40, 0, 1, 5, -40];
    for (column, entities) in columns.into_iter().zip(got[6..].chunks(4)) {
        let name = format!("tile 0 {column}.");
        assert!(
            entities.iter().all(|(_, text)| text.contains(&name)),
            "{name} {entities:?}"
        );
    }
    assert!(got[0].1.contains("old, trust"));
}

#[test]
fn what_waits_is_overtaken_by_what_is_newer_and_counted() {
    let mut flow = Flow::default();
    let mut client = subscribed(&mut flow);
    let mut board = board(&[]);
    all(&mut client, &board, &mut flow, 101 * S);
    answer(&mut flow, 101 * S);
    // The link is full.
    flow.wrote(1_000_000);
    for id in 1..=10 {
        board.take_state(&state(id));
        assert!(all(&mut client, &board, &mut flow, 102 * S).is_empty());
    }
    answer(&mut flow, 102 * S);
    let got = all(&mut client, &board, &mut flow, 103 * S);
    let poses = got
        .iter()
        .filter(|(subscription, _)| *subscription == 104)
        .count();
    assert_eq!((poses, client.dropped), (1, 2 * 9));
}

#[test]
fn a_panel_that_is_opened_anew_gets_everything_anew() {
    let mut flow = Flow::default();
    let mut client = subscribed(&mut flow);
    let board = board(&[1, 2]);
    let mut count = |client: &mut Client, now_s: i64| {
        let mut got = Vec::new();
        for _ in 0..10 {
            got.extend(all(client, &board, &mut flow, now_s * S));
            answer(&mut flow, now_s * S);
        }
        got.iter()
            .filter(|(subscription, _)| *subscription >= 108)
            .count()
    };
    assert_eq!(count(&mut client, 101), 16, "without detail and with it");
    assert_eq!(count(&mut client, 102), 0);
    client.receive(r#"{"op":"unsubscribe","subscriptionIds":[108]}"#);
    assert_eq!(count(&mut client, 103), 0);
    client.receive(
        r#"{"op":"subscribe","subscriptions":[{"id":200,"channelId":8},{"id":9,"channelId":99}]}"#,
    );
    assert_eq!(count(&mut client, 104), 16);
}
