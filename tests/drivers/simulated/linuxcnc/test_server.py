"""The simulated controller against traces of LinuxCNC 2.9.0~pre1: the same bytes."""

import pytest

NEW_CLIENT = [
    ("get estop", b"ESTOP ON\r\n"),
    ("set estop off", b"SET NAK\r\n"),
    ("hello wrong me 1.0", b"HELLO NAK\r\n"),
    ("hello EMC", b"HELLO NAK\r\n"),
    ("hello EMC client 1.0", b"HELLO ACK EMCNETSVR 1.1\r\n"),
    ("set enable WRONG", b"set enable WRONG\r\nSET ENABLE NAK\n\r"),
    ("get enable", b"get enable\r\nENABLE OFF\r\n"),
    ("set enable EMCTOO", b"set enable EMCTOO\r\n"),
    ("set echo off", b"set echo off\r\n"),
    ("set verbose on", b"SET VERBOSE ACK\n\r"),
    ("get enable", b"ENABLE ON\r\n"),
]
GREETED = [
    ("get foo", b"GET FOO NAK\r\n\r\n"),
    ("get", b"GET NAK\r\n"),
    ("get mdi", b"GET MDI NAK\r\n\r\n"),
    ("set", b"SET NAK\n\r"),
    ("set foo bar", b"SET FOO NAK\n\r"),
    ("set mode", b"SET MODE NAK\n\r"),
    ("set machine banana", b"SET MACHINE NAK\n\r"),
    ("set set_wait banana", b"SET SET_WAIT NAK\n\r"),
    ("set machine on", b"SET MACHINE ACK\n\r"),
    ("get machine", b"MACHINE OFF\r\n"),
    ("get error", b"ERROR OK\r\n"),
    ("set set_wait done", b"SET SET_WAIT ACK\n\r"),
    ("set wait_mode done", b"SET WAIT_MODE NAK\n\r"),
    ("set mode mdi", b"SET MODE NAK\n\r"),
    ("set home -1", b"SET HOME NAK\n\r"),
    ("set abort", b"SET ABORT NAK\n\r"),
    ("set estop off", b"SET ESTOP ACK\n\r"),
    ("get estop", b"ESTOP OFF\r\n"),
    ("set mode mdi", b"SET MODE NAK\n\r"),
    ("SET Machine ON", b"SET MACHINE ACK\n\r"),
    ("get machine", b"MACHINE ON\r\n"),
    ("get joint_homed", b"JOINT_HOMED NO NO NO NO NO NO\r\n"),
    ("set mode mdi", b"SET MODE ACK\n\r"),
    ("get mode", b"MODE MANUAL\r\n"),
    ("set mdi G0 X10", b"SET MDI NAK\n\r"),
    ("get error", b"ERROR all joints must be homed before going into coordinated mode\r\n"),
    ("get error", b"ERROR Can't issue MDI command when not homed\r\n"),
    ("get error", b"ERROR OK\r\n"),
    ("set set_wait received", b"SET SET_WAIT ACK\n\r"),
    ("set mdi G0 X10", b"SET MDI ACK\n\r"),
    ("get error", b"ERROR Can't issue MDI command when not homed\r\n"),
    ("set enable off", b"SET ENABLE ACK\n\r"),
    ("set machine off", b"SET MACHINE NAK\n\r"),
]
READY = [
    ("get mode", b"MODE MDI\r\n"),
    ("set mdi G0 X10.5 Y20 Z560 A5 B-4 C3", b"SET MDI ACK\n\r"),
    ("get joint_pos", b"JOINT_POS 10.500000 20.000000 560.000000 5.000000 -4.000000 3.000000\r\n"),
    ("get abs_act_pos", b"ABS_ACT_POS 10.500000 20.000000 560.000000 5.000000 -4.000000 3.000000\r\n"),
    ("set mdi g0 z 500", b"SET MDI ACK\n\r"),
    ("get abs_act_pos", b"ABS_ACT_POS 10.500000 20.000000 500.000000 5.000000 -4.000000 3.000000\r\n"),
    ("set mdi G0 Z9000", b"SET MDI NAK\n\r"),
    ("get error", b"ERROR Linear move on line 0 fails kinematicsInverse\r\n"),
    ("get error", b"ERROR invalid params in linear command\r\n"),
    ("get error", b"ERROR OK\r\n"),
    ("set mdi G0 X1 Y", b"SET MDI NAK\n\r"),
    ("get error", b"ERROR No characters found in reading real value\r\n"),
    ("set mdi G0 X1 X2", b"SET MDI NAK\n\r"),
    ("get error", b"ERROR Multiple x words on one line\r\n"),
    ("set mdi G999", b"SET MDI NAK\n\r"),
    ("get error", b"ERROR G-code out of range\r\n"),
    ("set mdi G21 G90", b"SET MDI ACK\n\r"),
    ("set home -1", b"SET HOME ACK\n\r"),
    ("get error", b"ERROR can't do that (EMC_JOINT_HOME:123) in MDI mode\r\n"),
    ("set mode manual", b"SET MODE ACK\n\r"),
    ("set mdi G0 X1", b"SET MDI NAK\n\r"),
    ("get error", b"ERROR Must be in MDI mode to issue MDI command\r\n"),
    ("get teleop_enable", b"TELEOP_ENABLE YES\r\n"),
    ("set home -1", b"SET HOME ACK\n\r"),
    ("get error", b"ERROR must be in joint mode to home\r\n"),
    ("set teleop_enable off", b"SET TELEOP_ENABLE ACK\n\r"),
    ("set home -1", b"SET HOME ACK\n\r"),
    ("get error", b"ERROR OK\r\n"),
    ("get pos_offset", b"POS_OFFSET 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000\r\n"),
    ("get user_linear_units", b"USER_LINEAR_UNITS MM\r\n"),
]


def test_answers_before_and_during_the_greeting(client):
    me = client()
    for line, answer in NEW_CLIENT:
        me.expect(line, answer)


def test_answers_in_emergency_stop_and_before_homing(greeted):
    for line, answer in GREETED:
        greeted.expect(line, answer)


def test_answers_when_ready_to_move(ready):
    for line, answer in READY:
        ready.expect(line, answer)


def test_an_unknown_first_word_gets_no_answer(greeted):
    greeted.send("foo bar")
    greeted.send("")
    greeted.expect_silence()
    greeted.expect("get mode", b"MODE MANUAL\r\n")


def test_a_line_longer_than_the_buffer_is_fatal(client):
    me = client()
    me.send("x" * 255)
    me.send("get estop")
    assert me.receive(10) == b"ESTOP ON\r\n"
    me.send("x" * 256)
    me.expect_end()


def test_one_client_commands_at_a_time(ready, greeted):
    ready.expect("get enable", b"ENABLE OFF\r\n")
    ready.expect("set mode manual", b"SET MODE NAK\n\r")
    ready.does("set enable EMCTOO")
    greeted.expect("set abort", b"SET ABORT NAK\n\r")


@pytest.mark.parametrize(
    ("order", "answer", "machine_is"),
    [
        ("set abort", b"SET ABORT ACK\n\r", b"MACHINE ON\r\n"),
        ("set machine off", b"SET MACHINE ACK\n\r", b"MACHINE OFF\r\n"),
        ("set estop on", b"SET ESTOP ACK\n\r", b"MACHINE OFF\r\n"),
    ],
)
def test_a_move_that_another_client_ends_is_acknowledged(ready, client, machine, order, answer, machine_is):
    ready.moves_slowly(machine)
    other = client()
    other.greet()
    other.expect(order, answer)
    assert ready.receive(13) == b"SET MDI ACK\n\r"
    assert machine.pose().x < 99.0
    ready.expect("get machine", machine_is)
    ready.expect("get joint_homed", b"JOINT_HOMED YES YES YES YES YES YES\r\n")


def test_switching_on_reads_the_config_again(ready, machine):
    ready.does("set mdi G0 X10")
    machine.config = 2.0
    ready.does("set machine on")
    assert machine.pose().x == 10.0
    ready.does("set machine off | set machine on")
    assert machine.pose().x == 8.0
    assert machine.joints()[0] == 10.0
    assert machine.events == ["on", "home", "move", "on"]


def test_a_config_that_cannot_be_used_keeps_the_machine_off(greeted, machine):
    machine.config = None
    greeted.does("set estop off | set machine on")
    greeted.expect("get machine", b"MACHINE OFF\r\n")
    greeted.expect("get error", b"ERROR machine.ini: has no geometry\r\n")


def test_aborted_homing_leaves_the_machine_unhomed(greeted, machine):
    machine.duration_s = 30.0
    greeted.does("set estop off | set machine on | set home -1")
    machine.wait_for("home")
    greeted.does("set abort")
    greeted.expect("get joint_homed", b"JOINT_HOMED NO NO NO NO NO NO\r\n")


@pytest.mark.parametrize("fault", ["estop", "following error"])
def test_faults_during_a_move_stop_it(ready, simulated, machine, fault):
    ready.moves_slowly(machine)
    if fault == "estop":
        simulated.state.set_estop(on=True)
    else:
        simulated.state.exceed_following_error()
    assert ready.receive(13) == b"SET MDI ACK\n\r"
    ready.expect("get machine", b"MACHINE OFF\r\n")
    ready.expect("get estop", b"ESTOP ON\r\n" if fault == "estop" else b"ESTOP OFF\r\n")
    ready.expect("get error", b"ERROR OK\r\n" if fault == "estop" else b"ERROR joint 3 following error\r\n")
    assert machine.pose().x < 99.0
