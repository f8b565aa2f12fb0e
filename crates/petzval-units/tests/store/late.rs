//! Machines that share a file server which shows changes late.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use petzval_base::Cancel;
use petzval_base::random::{Stage, Stream};
use petzval_jobs::ErrorReport;
use petzval_units::store::{Attempt, Begun, Clock, FileLayer, Holder, STALE_AFTER, Seen, Store, UnitState};
use petzval_units::unit::Prepared;
use serde_json::json;

use crate::layers::{Late, Server, Simulated};
use crate::{prepared, trivial};

/// Parts of a unit's work, each of which is kept.
const PARTS: u64 = 6;

/// Machines, all of which work until the units are done.
struct Machine {
    layer: Arc<Late>,
    store: Store,
    holder: Holder,
    seen: Seen,
    working: Option<(usize, Box<Attempt>)>,
    /// Until when it stands still, with its clock.
    frozen_until: Duration,
}

fn machine(number: usize, server: &Arc<Server>, clock: &Arc<Simulated>) -> Machine {
    let layer = Arc::new(Late { server: server.clone(), clock: clock.clone(), machine: number });
    let store = Store::on(Path::new("/shared/store"), layer.clone(), clock.clone()).unwrap();
    let holder = Holder { host: format!("node{number}"), pid: 1, process_start: 0, system: String::new() };
    Machine { layer, store, holder, seen: Seen::default(), working: None, frozen_until: Duration::ZERO }
}

/// What a part adds to the result of a unit: a result without every part in its order is another one.
fn with_part(sum: u64, part: u64) -> u64 {
    sum.wrapping_mul(31).wrapping_add(part + 1)
}

/// Begins a unit, if it can be begun, from what an earlier attempt has kept.
fn begin(machine: &mut Machine, units: &[Prepared], from: usize) {
    for place in 0..units.len() {
        let place = (place + from) % units.len();
        let Machine { store, holder, seen, .. } = &mut *machine;
        let begun = store.begin(&units[place], holder, false, seen, &Cancel::default()).unwrap();
        if let Begun::Mine(attempt) = begun {
            if let Some((earlier, has_ended)) = attempt.earlier().unwrap().first() {
                attempt.take_over(earlier, *has_ended).unwrap();
            }
            machine.working = Some((place, attempt));
            return;
        }
    }
}

/// Does a part of a unit. Returns the number of an attempt whose result counts.
fn work(machine: &mut Machine) -> Option<(usize, u32)> {
    let (place, mut attempt) = machine.working.take()?;
    let path = attempt.folder().join("progress");
    let (part, sum): (u64, u64) = match machine.layer.read(&path) {
        Ok(bytes) => serde_json::from_slice(&bytes).unwrap(),
        Err(_) => (0, 0),
    };
    if part < PARTS {
        let next = serde_json::to_vec(&(part + 1, with_part(sum, part))).unwrap();
        machine.layer.replace(&path, &next).unwrap();
        attempt.renew().unwrap();
        machine.working = Some((place, attempt));
        return None;
    }
    let number = attempt.number();
    attempt.keep_contents().unwrap();
    let result = attempt.finish(json!({"sum": sum})).unwrap();
    Some((place, result.attempt)).filter(|_| result.attempt == number)
}

/// Machines are killed, stopped and frozen at random, and every unit ends with one result, made of every part once.
#[test]
fn units_are_done_once_on_a_server_that_shows_changes_late() {
    let units: Vec<Prepared> =
        (0..5).map(|i| prepared(&trivial(&format!("unit {i}"), f64::from(i)))).collect();
    let expected = (0..PARTS).fold(0, with_part);
    let (mut lost, mut taken_over) = (0, 0);
    for seed in 0..40 {
        let (server, clock) = (Arc::new(Server::default()), Arc::new(Simulated::default()));
        let mut machines: Vec<Machine> = (0..4).map(|number| machine(number, &server, &clock)).collect();
        let mut winners = vec![Vec::new(); units.len()];
        let mut next_machine = machines.len();
        for step in 0.. {
            assert!(step < 20_000, "seed {seed}: the units do not end");
            let [choice, chance] = Stream::new(seed, step, Stage::Search).uniforms(0, 0);
            let [pause, other] = Stream::new(seed, step, Stage::Search).uniforms(1, 0);
            clock.wait(Duration::from_secs_f64(4.0 * pause));
            let which = (choice * machines.len() as f64) as usize;
            if machines[which].frozen_until > clock.now() {
                continue;
            }
            match chance {
                // Killed: another process, which knows nothing, takes its place.
                ..0.04 => {
                    lost += usize::from(machines[which].working.is_some());
                    machines[which] = machine(next_machine, &server, &clock);
                    next_machine += 1;
                }
                ..0.06 => {
                    if let Some((_, attempt)) = machines[which].working.take() {
                        attempt.stop().unwrap();
                    }
                }
                // Suspended for longer than a claim lives, with its unit.
                ..0.07 => machines[which].frozen_until = clock.now() + 2 * STALE_AFTER,
                _ if machines[which].working.is_some() => {
                    if let Some((place, attempt)) = work(&mut machines[which]) {
                        winners[place].push(attempt);
                    }
                }
                _ => begin(&mut machines[which], &units, (other * units.len() as f64) as usize),
            }
            if winners.iter().all(|winners| !winners.is_empty())
                && machines.iter().all(|machine| machine.working.is_none())
            {
                break;
            }
        }
        clock.wait(Duration::from_secs(10));
        let store = machine(next_machine, &server, &clock).store;
        assert_eq!(store.keys().unwrap().len(), units.len());
        for (unit, winners) in units.iter().zip(&winners) {
            let result = store.result(&unit.key).unwrap().unwrap();
            assert_eq!(*winners, [result.attempt], "seed {seed}: {} counts once", unit.unit.name);
            assert_eq!(result.response["sum"], expected, "seed {seed}: {}", unit.unit.name);
            taken_over += usize::from(result.attempt > 1);
        }
    }
    assert!(lost > 20 && taken_over > 20, "{lost} lost, {taken_over} taken over: the test shows nothing");
}

#[test]
fn a_claim_is_stale_by_the_clock_of_the_reader_and_a_living_owner_does_no_harm() {
    let (server, clock) = (Arc::new(Server::default()), Arc::new(Simulated::default()));
    let unit = prepared(&trivial("unit", 1.0));
    let (mut one, mut two) = (machine(0, &server, &clock), machine(1, &server, &clock));
    begin(&mut one, std::slice::from_ref(&unit), 0);
    work(&mut one);
    // The first look of the other machine is late: only what it sees unchanged counts.
    clock.wait(3 * STALE_AFTER);
    let state = |machine: &mut Machine| machine.store.state(&unit.key, &mut machine.seen).unwrap();
    assert!(matches!(state(&mut two), UnitState::Running { attempt: 1, .. }));
    clock.wait(STALE_AFTER - Duration::from_secs(1));
    assert!(matches!(state(&mut two), UnitState::Running { attempt: 1, .. }));
    // A renewal that becomes visible begins the count anew.
    work(&mut one);
    clock.wait(Duration::from_secs(6));
    assert!(matches!(state(&mut two), UnitState::Running { attempt: 1, .. }));
    clock.wait(STALE_AFTER);
    assert!(matches!(state(&mut two), UnitState::Stale { attempt: 1, .. }));
    begin(&mut two, std::slice::from_ref(&unit), 0);
    let second = two.working.as_ref().unwrap().1.number();
    assert_eq!(second, 2);
    // The owner of the stale claim lives, and learns of the other one once its claim is visible.
    clock.wait(Duration::from_secs(6));
    let (_, attempt) = one.working.as_mut().unwrap();
    assert_eq!(attempt.renew().unwrap().unwrap().holder.host, "node1");
    // Both end; the first result counts, and both are the same.
    let ended = |machine: &mut Machine| loop {
        if machine.working.is_none() {
            break None;
        }
        if let Some(ended) = work(machine) {
            break Some(ended.1);
        }
    };
    assert_eq!((ended(&mut two), ended(&mut one)), (Some(2), None));
    clock.wait(Duration::from_secs(6));
    let UnitState::Done(result) = state(&mut one) else { panic!() };
    assert_eq!((result.attempt, &result.response["sum"]), (2, &json!((0..PARTS).fold(0, with_part))));
}

/// Begins a unit that has failed or is damaged again.
fn again(machine: &mut Machine, unit: &Prepared) -> Begun {
    let Machine { store, holder, seen, .. } = machine;
    store.begin(unit, holder, true, seen, &Cancel::default()).unwrap()
}

/// A begun attempt.
fn mine(begun: Begun) -> Box<Attempt> {
    let Begun::Mine(attempt) = begun else { panic!("this machine may not run the unit") };
    attempt
}

/// The error of a unit that fails.
fn error() -> ErrorReport {
    ErrorReport {
        kind: "failed".to_owned(),
        message: "it failed".to_owned(),
        place: None,
        hint: String::new(),
        stopped: None,
    }
}

/// How long it takes until every change is visible.
const VISIBLE: Duration = Duration::from_secs(6);

#[test]
fn a_failed_unit_that_two_machines_run_again_at_once_is_run_by_one() {
    let (server, clock) = (Arc::new(Server::default()), Arc::new(Simulated::default()));
    let unit = prepared(&trivial("unit", 1.0));
    let (mut one, mut two) = (machine(0, &server, &clock), machine(1, &server, &clock));
    mine(again(&mut one, &unit)).fail(error()).unwrap();
    clock.wait(VISIBLE);
    let second = mine(again(&mut one, &unit));
    assert_eq!(second.number(), 2);
    // The claim decides, at once and while it is not visible yet.
    assert!(matches!(again(&mut two, &unit), Begun::Elsewhere(None)));
    clock.wait(VISIBLE / 3);
    assert!(matches!(again(&mut two, &unit), Begun::Elsewhere(None)));
    clock.wait(VISIBLE);
    assert!(matches!(again(&mut two, &unit), Begun::Elsewhere(Some(_))));
    // Its failure is that of both.
    second.fail(error()).unwrap();
    clock.wait(VISIBLE);
    let Begun::Failed(failure) = again(&mut two, &unit) else { panic!("the unit is run a third time") };
    assert_eq!(failure.attempt, 2);
    // A later command runs it once more, and every machine has that result.
    let third = mine(again(&mut machine(2, &server, &clock), &unit));
    assert_eq!(third.finish(json!({"sum": 7})).unwrap().attempt, 3);
    clock.wait(VISIBLE);
    assert!(matches!(again(&mut two, &unit), Begun::Done(result) if result.attempt == 3));
}

/// One machine has failed again before the other, which began at the same time, comes to the unit.
#[test]
fn what_failed_again_since_a_command_began_is_not_run_once_more_by_it() {
    let (server, clock) = (Arc::new(Server::default()), Arc::new(Simulated::default()));
    let unit = prepared(&trivial("unit", 1.0));
    let (mut one, mut two) = (machine(0, &server, &clock), machine(1, &server, &clock));
    mine(again(&mut one, &unit)).fail(error()).unwrap();
    clock.wait(VISIBLE);
    for machine in [&mut one, &mut two] {
        machine.store.note_failures([&unit.key], &mut machine.seen).unwrap();
    }
    mine(again(&mut one, &unit)).fail(error()).unwrap();
    clock.wait(VISIBLE);
    let Begun::Failed(failure) = again(&mut two, &unit) else { panic!("the unit is run a third time") };
    assert_eq!(failure.attempt, 2);
}

#[test]
fn a_damaged_unit_that_two_machines_run_again_at_once_is_set_aside_once() {
    let (server, clock) = (Arc::new(Server::default()), Arc::new(Simulated::default()));
    let unit = prepared(&trivial("unit", 1.0));
    let (mut one, mut two) = (machine(0, &server, &clock), machine(1, &server, &clock));
    let result = one.store.folder(&unit.key).join("result.json");
    one.layer.replace(&result, b"{").unwrap();
    clock.wait(VISIBLE);
    let attempt = mine(again(&mut one, &unit));
    // The second machine still sees the damaged folder: what it would set aside is the new one.
    assert!(matches!(again(&mut two, &unit), Begun::Elsewhere(None)));
    clock.wait(VISIBLE / 3);
    assert!(matches!(again(&mut two, &unit), Begun::Elsewhere(None)));
    clock.wait(VISIBLE);
    assert!(matches!(again(&mut two, &unit), Begun::Elsewhere(Some(_))));
    assert_eq!(attempt.finish(json!({"sum": 7})).unwrap().attempt, 1);
    clock.wait(VISIBLE);
    assert!(matches!(again(&mut two, &unit), Begun::Done(result) if result.response["sum"] == 7));
    let aside = two.store.root().join(format!(".damaged-{}-1/result.json", unit.key.as_str()));
    assert_eq!(two.layer.read(&aside).unwrap(), b"{");
}

#[test]
fn files_of_a_result_that_are_under_way_are_no_damage() {
    let (server, clock) = (Arc::new(Server::default()), Arc::new(Simulated::default()));
    let unit = prepared(&trivial("unit", 1.0));
    let (mut one, mut two) = (machine(0, &server, &clock), machine(1, &server, &clock));
    begin(&mut one, std::slice::from_ref(&unit), 0);
    let finished = std::iter::repeat_with(|| work(&mut one)).take(2 * PARTS as usize).flatten().next();
    assert_eq!(finished, Some((0, 1)));
    clock.wait(VISIBLE);
    let state = |machine: &mut Machine| machine.store.state(&unit.key, &mut machine.seen).unwrap();
    assert!(matches!(state(&mut two), UnitState::Done(_)));
    let folder = two.store.folder(&unit.key);
    one.layer.remove_folder(&folder.join("files")).unwrap();
    assert!(matches!(state(&mut two), UnitState::Done(_)));
    clock.wait(VISIBLE);
    assert!(matches!(state(&mut two), UnitState::Damaged(_)));
    // Before the attempt is seen to have ended, its files may be under way from its own folder.
    let record = br#"{"renewed": 6, "seconds": 1.0, "cpu_seconds": 1.0}"#;
    two.layer.replace(&folder.join("attempt-0001.json"), record).unwrap();
    assert!(matches!(state(&mut two), UnitState::Done(_)));
    // Its process may have been killed before it could say so: no change is under way for so long.
    clock.wait(Duration::from_secs(89));
    assert!(matches!(state(&mut two), UnitState::Done(_)));
    clock.wait(Duration::from_secs(2));
    assert!(matches!(state(&mut two), UnitState::Damaged(_)));
    // A process that knows nothing waits as long before it runs the unit again, unless it is cancelled.
    let (mut three, cancel, before) = (machine(2, &server, &clock), Cancel::default(), clock.now());
    cancel.set();
    let begun = three.store.begin(&unit, &three.holder, true, &mut three.seen, &cancel).unwrap();
    assert!(matches!(begun, Begun::Cancelled) && clock.now() == before);
    assert_eq!(mine(again(&mut three, &unit)).number(), 1);
    assert!(clock.now() - before > Duration::from_secs(90));
}
