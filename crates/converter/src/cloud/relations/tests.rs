use super::*;

fn schema() -> Schema {
    let of = |name: &str, ty| Attribute::new(name, ty, 1);
    Schema::new(vec![
        of("classification", AttributeType::UInt8),
        of("a", AttributeType::UInt16),
        of("b", AttributeType::UInt16),
        of("c", AttributeType::Float64),
        of("d", AttributeType::Int8),
    ])
}

fn record(class: u8, a: u16, b: u16, c: f64, d: i8) -> Vec<u8> {
    let mut record = vec![0; 12];
    record.push(class);
    record.extend(a.to_le_bytes());
    record.extend(b.to_le_bytes());
    record.extend(c.to_le_bytes());
    record.push(d as u8);
    record
}

fn seen(records: &[Vec<u8>]) -> Relations {
    let schema = schema();
    let mut relations = Relations::new(&schema);
    relations.add(&records.concat(), schema.stride);
    relations
}

fn chosen(relations: &Relations) -> Vec<Option<Relation>> {
    relations.choose(&schema(), &[false; 5])
}

/// b is a, c follows from a, d from all of them, the class from nothing.
fn scene(n: u16) -> Vec<Vec<u8>> {
    let of = |i: u16| record((i % 7) as u8, i % 200, i % 200, f64::from(i % 200 / 3) / 8.0, -((i % 200 / 50) as i8));
    (0..n).map(of).collect()
}

#[test]
fn what_follows_from_others_is_found_and_what_others_follow_from_stays() {
    let found = chosen(&seen(&scene(2000)));
    assert_eq!(found[0], None, "renderers look for classes");
    assert_eq!(found[1], None);
    assert_eq!(found[2], Some(Relation::SameAs(1)));
    let Some(Relation::FollowsFrom { attribute: 1, table }) = &found[3] else { panic!("{:?}", found[3]) };
    assert_eq!((table.len(), table[199]), (200, [199.0, 66.0 / 8.0]));
    let Some(Relation::FollowsFrom { attribute: 1, table }) = &found[4] else { panic!("{:?}", found[4]) };
    assert_eq!((table[0], table[150]), ([0.0, 0.0], [150.0, -3.0]));
}

#[test]
fn one_point_that_contradicts_ends_a_relation() {
    for (odd, ended) in [(record(0, 7, 8, 0.25, 0), 2), (record(0, 7, 7, 0.5, 0), 3), (record(0, 7, 7, 0.25, 1), 4)] {
        let mut records = scene(2000);
        assert!(chosen(&seen(&records))[ended].is_some());
        records.push(odd);
        assert_eq!(chosen(&seen(&records))[ended], None, "{ended}");
    }
}

#[test]
fn a_table_has_at_most_256_keys() {
    let of = |n: u16| {
        let records: Vec<_> = (0..n).map(|i| record(0, i, i % 2, f64::from(i % 100), 0)).collect();
        chosen(&seen(&records))[3].clone()
    };
    assert!(matches!(of(256), Some(Relation::FollowsFrom { attribute: 1, .. })));
    assert_eq!(of(257), None);
    let odd = |i: u16| record(0, i % 3, 0, if i % 3 == 1 { f64::NAN } else { 1.0 }, 0);
    assert_eq!(chosen(&seen(&(0..9).map(odd).collect::<Vec<_>>()))[3], None, "JSON has no such number");
}

#[test]
fn parts_of_the_points_in_any_order_give_what_all_of_them_give() {
    let mut random = pointmill_testkit::Random::new(5);
    for round in 0..200 {
        // attributes that are constant for a while, and begin to vary in one of the parts
        let turns = [(); 4].map(|()| random.below(400));
        let keys = 1 + random.below(if round % 2 == 0 { 300 } else { 4 });
        let of = |i: u64| {
            let key = i * 7 % keys;
            let late = |turn: u64, v: u64| if i < turn { 0 } else { v };
            let (a, b) = (late(turns[0], key), late(turns[1], key % 3));
            record((i % 5) as u8, a as u16, b as u16, late(turns[2], a / 2) as f64, late(turns[3], b) as i8)
        };
        let records: Vec<_> = (0..400).map(of).collect();
        let all = seen(&records);
        let cut = random.below(400) as usize;
        let parts = [&records[..cut / 2], &records[cut / 2..cut], &records[cut..]].map(seen);
        for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0], [2, 1, 0]] {
            let mut merged = Relations::new(&schema());
            order.iter().for_each(|part| merged.merge(&parts[*part]));
            assert_eq!(chosen(&merged), chosen(&all), "round {round}, {order:?}");
        }
    }
}
